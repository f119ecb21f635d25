"""The head folder: what `mien build` leaves, readable without mien.

docs/reference/head-folder.md describes it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from mien.arrays import Array, UInt8
from mien.errors import DocumentError, FileFormatError, InputError
from mien.head import NEUTRAL, Expression, Head
from mien.io.files.atomic import atomic_folder, check_folder_place
from mien.io.files.image import encode_image, load_image
from mien.io.files.leftovers import finish_replacement
from mien.io.head.head_geometry import check_names, load_geometry
from mien.io.head.head_json import (
    HEAD_FORMAT,
    Json,
    check_head_format,
    head_to_json,
    shading_from_json,
    texts_from_json,
    texture_paths,
    units_and_gaze_from_json,
    verdict_from_json,
    views_from_json,
)
from mien.io.head.region_masks import MASK_FILES, load_masks, save_masks
from mien.limits import MAX_SIDE
from mien.reading.names import check_path, is_inside
from mien.reading.strict_json import JsonValue, read_json

HEAD, GEOMETRY = "head.json", "geometry.npz"

Photos = Iterable[tuple[str, UInt8[Array, "h w 3"]]]


def save_head(
    head: Head,
    folder: str | Path,
    *,
    photos: Photos = (),
    annotations: Mapping[str, Json] | None = None,
) -> None:
    """Write a head folder in place of the one that is there, whole or not at all.

    Args:
        head: what `load_head` gives back, to float32.
        folder: the place.
        photos: name and (h, w, 3) pixels, orientation applied; taken one at a time.
        annotations: contents of `annotations/NAME.json` by NAME, as they were used.

    Raises:
        InputError: the place holds something else or cannot be written; a photo's name.
    """
    with head_place(folder) as temporary:
        write_head(head, temporary, photos=photos, annotations=annotations)


def head_place(
    folder: str | Path, *, read: Iterable[str | Path] = ()
) -> AbstractContextManager[Path]:
    """An empty folder that becomes the head folder when the block ends without an error.

    What mien did not write into the old one stays, masks that were painted, too.

    Args:
        folder: the place.
        read: what the head is made from, which must not lie in the folder.

    Raises:
        InputError: as save_head.
    """
    return atomic_folder(folder, replaces=is_head_folder, read=read, editable=MASK_FILES)


def write_head(
    head: Head,
    folder: Path,
    *,
    photos: Photos = (),
    annotations: Mapping[str, Json] | None = None,
) -> None:
    """As save_head, but straight into an empty folder: for a caller that adds more to it."""
    photo_files = {name: _write_photo(folder, name, pixels) for name, pixels in photos}
    (folder / "textures").mkdir()
    for name, texture in head.textures.items():
        (folder / "textures" / f"{name}.png").write_bytes(encode_image(texture, "PNG"))
    save_masks(folder, head.mesh, head.regions)
    for name, annotation in (annotations or {}).items():
        file = folder / "annotations" / f"{name}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        _write_json(file, annotation)
    np.savez_compressed(folder / GEOMETRY, **_geometry(head))
    _write_json(folder / HEAD, head_to_json(head, photo_files))


def is_head_folder(folder: Path) -> bool:
    """Whether mien made this folder, of whatever version."""
    return HEAD_FORMAT.is_in(folder / HEAD)


def check_head_place(folder: str | Path, *, read: Iterable[str | Path] = ()) -> None:
    """Refuse a place for a head before the work is done. Raises: InputError, as head_place."""
    check_folder_place(folder, replaces=is_head_folder, read=read)


def load_head(folder: str | Path) -> Head:
    """The head in a folder.

    Raises:
        InputError: no such folder.
        FileFormatError: something in it is missing, damaged or newer than this program; the message
            names the file and the place in it.
    """
    folder = check_path("head", folder, "a head folder that `mien build` made")
    if not folder.is_dir():
        finish_replacement(folder)
    if not folder.is_dir():
        raise InputError(
            folder,
            "a head folder that `mien build` made",
            "a file" if folder.exists() else "nothing at that place",
        )
    path = folder / HEAD
    if not path.exists():
        raise FileFormatError(path, "there is no such file; is this a head folder?")
    data = JsonValue(read_json(path))
    try:
        check_head_format(data)
        return _head_from(folder, data)
    except DocumentError as error:
        raise FileFormatError(path, error.problem, error.place) from None
    except InputError as error:
        raise FileFormatError(path, f"{error} (or the other files do not fit it)") from None


def _head_from(folder: Path, data: JsonValue) -> Head:
    described = data["expressions"].members()
    _ = data["expressions"][NEUTRAL]
    unit_names = data["face_units"].names()
    part_names = data["parts"].names()
    geometry = load_geometry(folder / GEOMETRY, tuple(described), part_names, len(unit_names))
    check_names(geometry.mesh, unit_names)
    shapes = {
        name: Expression(
            vertices=geometry.shapes[name],
            views=views_from_json(item["cameras"]),
            texture=item["texture"].text(),
            **units_and_gaze_from_json(item),
        )
        for name, item in described.items()
    }
    files = texture_paths(data["textures"])
    textures = {name: load_image(folder / file) for name, file in files.items()}
    _check_textures(folder, files, textures, shapes)
    return Head(
        subject=data["subject"].text(),
        mesh=geometry.mesh,
        expressions=shapes,
        uncertainty_mm=geometry.uncertainty_mm,
        unit_names=unit_names,
        unit_offsets=geometry.unit_offsets,
        textures=textures,
        regions=load_masks(folder, geometry.mesh),
        shading=shading_from_json(data),
        left_out=texts_from_json(data["left_out"]),
        verdict=verdict_from_json(data),
        generator=data["generator"].text(),
    )


def _check_textures(
    folder: Path,
    files: Mapping[str, str],
    textures: Mapping[str, UInt8[Array, "h w 3"]],
    shapes: Mapping[str, Expression],
) -> None:
    """Those that are mixed must be of one size, neutral's among them.

    Raises:
        FileFormatError: names the file. DocumentError: neutral has none.
    """
    neutral = textures.get(shapes[NEUTRAL].texture)
    if neutral is None:
        known = ", ".join(textures)[:60] or "none"
        problem = f"expected one of the textures, found {shapes[NEUTRAL].texture[:60]!r} of {known}"
        raise DocumentError(f"expressions.{NEUTRAL}.texture", problem)
    for name, pixels in textures.items():
        largest = max(pixels.shape[:2])
        if largest > MAX_SIDE:
            problem = f"expected at most {MAX_SIDE} px a side, found {largest}"
            raise FileFormatError(folder / files[name], problem)
    for shape in shapes.values():
        own = textures.get(shape.texture)
        if own is not None and own.shape != neutral.shape:
            expected, found = (f"{p.shape[1]}x{p.shape[0]}" for p in (neutral, own))
            problem = f"expected {expected} px as neutral's texture, found {found}"
            raise FileFormatError(folder / files[shape.texture], problem)


def _geometry(head: Head) -> dict[str, Any]:
    mesh = head.mesh
    shapes = {
        f"vertices/{name}": expression.vertices.astype(np.float32)
        for name, expression in head.expressions.items()
    }
    return shapes | {
        "triangles": mesh.triangles.astype(np.int32),
        "uvs": mesh.uvs.astype(np.float32),
        "uv_triangles": mesh.uv_triangles.astype(np.int32),
        "part": mesh.part.astype(np.uint8),
        "uncertainty_mm": head.uncertainty_mm.astype(np.float32),
        "unit_offsets": head.units.astype(np.float32),
    }


def _write_photo(folder: Path, name: str, pixels: UInt8[Array, "h w 3"]) -> str:
    """The photo's place in the folder: its own name where its kind can be written again."""
    relative = PurePosixPath("photos") / name
    if not is_inside(name):
        raise InputError("photos", "names that stay inside the folder", repr(name))
    kind = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}.get(relative.suffix.lower())
    if kind is None:
        relative, kind = relative.with_name(f"{relative.name}.jpg"), "JPEG"
    file = folder / relative
    if file.exists():
        raise InputError("photos", "every name once", f"{name} twice")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(encode_image(pixels, kind))
    return str(relative)


def _write_json(path: Path, data: Json) -> None:
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
