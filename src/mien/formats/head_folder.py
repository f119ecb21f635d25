"""The head folder: what `mien build` leaves, readable without mien (docs/head-folder.md)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from mien.arrays import Array, UInt8
from mien.capture.files import named_path
from mien.errors import Broken, FileFormatError, InputError
from mien.formats.atomic import atomic_folder, check_folder_place
from mien.formats.head_json import (
    FORMAT,
    Json,
    check_version,
    get,
    get_names,
    get_path,
    get_texts,
    head_to_json,
    is_inside,
    motion_from_json,
    shading_from_json,
    views_from_json,
)
from mien.formats.image import encode_image, load_image
from mien.formats.npz import read_arrays
from mien.formats.region_masks import read_masks, write_masks
from mien.mesh import Mesh
from mien.model.head import NEUTRAL, Expression, Head

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
        photos: name and (h, w, 3) pixels, orientation applied; taken one at a time.
        annotations: contents of `annotations/NAME.json` by NAME, as they were used.
    Raises: InputError: the place holds something else or cannot be written; a photo's name.
    """
    with atomic_folder(folder, replaces=is_head_folder) as temporary:
        write_head(head, temporary, photos=photos, annotations=annotations)


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
    write_masks(folder, head.mesh, head.regions)
    for name, annotation in (annotations or {}).items():
        file = folder / "annotations" / f"{name}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        _write_json(file, annotation)
    np.savez_compressed(folder / "geometry.npz", **_geometry(head))
    _write_json(folder / "head.json", head_to_json(head, photo_files))


def is_head_folder(folder: Path) -> bool:
    """Whether mien made this folder, of whatever version."""
    try:
        return bool(_read_json(folder / "head.json").get("format") == FORMAT)
    except FileFormatError:
        return False


def check_head_place(folder: str | Path) -> None:
    """Refuse a place for a head before the work is done. Raises: InputError, as save_head."""
    check_folder_place(folder, replaces=is_head_folder)


def load_head(folder: str | Path) -> Head:
    """The head in a folder.

    Raises: InputError: no such folder. FileFormatError: something in it is missing, damaged or
        newer than this program; the message names the file and the place in it.
    """
    folder = named_path("head", folder, "a head folder that `mien build` made")
    if not folder.is_dir():
        raise InputError(folder, "a head folder that `mien build` made", _what_is(folder))
    path = folder / "head.json"
    data = _read_json(path)
    try:
        check_version(data)
        return _head_from(folder, data)
    except Broken as broken:
        raise FileFormatError(path, broken.problem, broken.place) from None
    except (InputError, ValueError) as error:
        raise FileFormatError(path, f"{error} (or the other files do not fit it)") from None


def _head_from(folder: Path, data: Json) -> Head:
    arrays = read_arrays(folder / "geometry.npz")
    expressions = get(data, "expressions", dict)
    shapes = {
        name: Expression(
            vertices=arrays[f"vertices/{name}"],
            views=views_from_json(expressions, name),
            texture=get(expressions[name], "texture", str, f"expressions.{name}"),
            **motion_from_json(expressions[name], f"expressions.{name}"),
        )
        for name in expressions
    }
    if NEUTRAL not in shapes:
        raise Broken(f"expressions.{NEUTRAL}", "missing")
    mesh = Mesh(
        vertices=shapes[NEUTRAL].vertices,
        triangles=arrays["triangles"],
        uvs=arrays["uvs"],
        uv_triangles=arrays["uv_triangles"],
        part=arrays["part"],
        part_names=get_names(data, "parts"),
    )
    files = get(data, "textures", dict)
    return Head(
        subject=get(data, "subject", str),
        mesh=mesh,
        expressions=shapes,
        uncertainty_mm=arrays["uncertainty_mm"],
        unit_names=get_names(data, "face_units"),
        unit_offsets=arrays["unit_offsets"],
        textures={name: load_image(folder / get_path(files, name, "textures")) for name in files},
        regions=read_masks(folder, mesh),
        shading=shading_from_json(data),
        left_out=get_texts(data, "left_out"),
        generator=get(data, "generator", str),
    )


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


def _read_json(path: Path) -> Json:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileFormatError(path, "there is no such file; is this a head folder?") from None
    except json.JSONDecodeError as error:
        raise FileFormatError(path, error.msg, f"line {error.lineno}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(path, f"not a readable text file ({error})") from None
    if not isinstance(data, dict):
        raise FileFormatError(path, "expected one JSON object")
    return data


def _what_is(folder: Path) -> str:
    return "a file" if folder.exists() else "nothing at that place"
