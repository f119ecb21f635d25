"""The example folder: what `mien examples` leaves (docs/reference/example-folder.md)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.subregions import Subregions, default_subregions
from mien.errors import DocumentError, EstimationError, FileFormatError, InputError
from mien.io.examples.example_json import (
    EXAMPLES_FORMAT,
    STATISTICS,
    check_layout,
    examples_to_json,
    photo_file,
    photo_from_json,
    points_from_json,
)
from mien.io.files.atomic import atomic_folder, check_folder_place
from mien.io.files.image import encode_image, load_image
from mien.io.files.leftovers import finish_replacement
from mien.numeric.kernels.threads import run_concurrently
from mien.reading.names import check_path, is_inside
from mien.reading.npz import ArrayFile
from mien.reading.strict_json import JsonValue, errors_name_file, read_json
from mien.synthesis.composition.example_warping import aligned_photos
from mien.synthesis.examples.example_set import Example, ExampleSet

__all__ = [
    "check_example_place",
    "is_example_folder",
    "load_examples",
    "load_reasons",
    "save_examples",
    "write_example_files",
]

INDEX, SUBREGIONS = "examples.json", "subregions.npz"

_MIN_EXTENT_PX = 0.01
"""Width and height of a face's points, at least."""

_PAIR = re.compile(r"\[\n\s*([-+\d.e]+),\n\s*([-+\d.e]+)\n\s*\]")
"""Two numbers, one a line: a point's, which read better in one line."""


def save_examples(
    folder: str | Path, example_set: ExampleSet, *, why: Mapping[str, str] | None = None
) -> None:
    """Write an example folder in place of the one that is there, whole or not at all.

    Args:
        folder: the place.
        example_set: the examples.
        why: the reason for each example, by name.

    Raises:
        InputError: the place holds something else or cannot be written; a name that is no file's.
    """
    with atomic_folder(folder, replaces=is_example_folder, editable=()) as temporary:
        write_example_files(temporary, example_set, why=why)


def write_example_files(
    folder: Path, example_set: ExampleSet, *, why: Mapping[str, str] | None = None
) -> None:
    """As save_examples, but straight into an empty folder: for a caller that adds more to it."""
    for example in example_set.examples:
        if not is_inside(f"{example.name}.png") or "/" in example.name:
            raise InputError("example", "a name that can be a file's", repr(example.name))
    for part in ("photos", "textures"):
        (folder / part).mkdir()
    for example, texture in zip(example_set.examples, aligned_photos(example_set), strict=True):
        _write_png(folder / photo_file(example), example.photo)
        _write_png(folder / "textures" / f"{example.name}.png", texture)
    standard = example_set.examples[example_set.standard]
    _write_png(folder / "standard.png", standard.photo)
    _write_png(folder / "subregions.png", _subregion_picture(example_set.subregions))
    if not _are_default(example_set):
        np.savez_compressed(folder / SUBREGIONS, **_subregion_arrays(example_set.subregions))
    np.savez_compressed(folder / STATISTICS, geometries=example_set.statistics)
    text = json.dumps(examples_to_json(example_set, why or {}), indent=1, allow_nan=False)
    (folder / INDEX).write_text(_PAIR.sub(r"[\1, \2]", text) + "\n", encoding="utf-8")


def is_example_folder(folder: Path) -> bool:
    """Whether mien made this folder, of whatever version."""
    return EXAMPLES_FORMAT.is_in(folder / INDEX)


def check_example_place(folder: str | Path, *, read: Iterable[str | Path] = ()) -> None:
    """Refuse a place for examples before the work is done.

    Args:
        folder: the place.
        read: what the examples are made from, which must not lie in the folder.

    Raises:
        InputError: the place holds something else, holds what is read, cannot be written.
    """
    check_folder_place(folder, replaces=is_example_folder, read=read)


def load_examples(folder: str | Path, *, layout: FeatureLayout | None = None) -> ExampleSet:
    """The examples in a folder, exactly as they were written.

    Args:
        folder: that `mien examples` or `save_examples` wrote.
        layout: of the points; mien's own unless given.

    Raises:
        InputError: no such folder.
        FileFormatError: something in it is missing, damaged, of another layout or newer than this
            program; the message names the file and the place in it.
    """
    folder = check_path("examples", folder, "an example folder that `mien examples` made")
    layout = layout or load_feature_layout()
    path, data = _read_index(folder)
    try:
        examples = _from_json(folder, data, layout)
        # Made now, where the file's name is known; points in one place have none.
        _ = examples.geometries
        return examples
    except DocumentError as error:
        raise FileFormatError(path, error.problem, error.place) from None
    except (InputError, EstimationError) as error:
        raise FileFormatError(path, f"{error} (or the other files do not fit it)") from None


def load_reasons(folder: str | Path) -> dict[str, str]:
    """Why each example was chosen, by name. Raises: as load_examples."""
    path, data = _read_index(Path(folder))
    reasons = {}
    with errors_name_file(path):
        for entry in data["examples"].items():
            reasons[entry["name"].text()] = entry.get("why", "").text()
    return reasons


def _read_index(folder: Path) -> tuple[Path, JsonValue]:
    path = folder / INDEX
    if not folder.is_dir():
        finish_replacement(folder)
    if not folder.is_dir():
        found = "a file" if folder.exists() else "nothing at that place"
        raise InputError(folder, "an example folder that `mien examples` made", found)
    if not path.exists():
        raise FileFormatError(path, "there is no such file; is this an example folder?")
    data = JsonValue(read_json(path))
    with errors_name_file(path):
        EXAMPLES_FORMAT.check(data)
    return path, data


def _from_json(folder: Path, data: JsonValue, layout: FeatureLayout) -> ExampleSet:
    check_layout(data["layout"], layout)
    # Most of the time goes into unpacking photos.
    reading = [partial(_example, folder, entry, layout) for entry in data["examples"].items()]
    examples = tuple(run_concurrently(*reading))
    if not examples:
        raise DocumentError("examples", "expected at least one, the neutral face; found none")
    names = [example.name for example in examples]
    neutral = data["neutral"]
    if neutral.raw != names[0]:
        found = f"found {str(neutral.raw)[:40]!r}"
        raise neutral.error(f"expected {names[0]!r}, the first example; {found}")
    teeth = data["teeth"].items()
    standard = names.index(data["standard"].choice("example", names))
    return ExampleSet(
        layout,
        examples,
        standard,
        _statistics(folder / STATISTICS, layout),
        _subregions(folder / SUBREGIONS, layout, examples[standard]),
        tuple(names.index(name.choice("example", names)) for name in teeth),
    )


def _example(folder: Path, data: JsonValue, layout: FeatureLayout) -> Example:
    file = photo_from_json(data["photo"])
    photo = load_image(folder / PurePosixPath(file))
    size = [item.raw for item in data["size"].items()]
    actual = [photo.shape[1], photo.shape[0]]
    if size != actual:
        raise FileFormatError(folder / file, f"expected {size} px, found {actual}")
    return Example(
        data["name"].text(),
        photo,
        points_from_json(data["points"], layout, max(actual)),
        data["source"].text(),
    )


def _statistics(path: Path, layout: FeatureLayout) -> Float[Array, "N n 2"]:
    with ArrayFile(path) as arrays:
        geometries = arrays.numbers("geometries", (None, len(layout.names), 2))
    if not len(geometries):
        raise FileFormatError(path, "expected at least one picture's points", "geometries")
    flat = np.flatnonzero(np.ptp(geometries, axis=1).min(axis=1) < _MIN_EXTENT_PX)
    if len(flat):
        problem = "expected points of a face, found all on one line or in one place"
        raise FileFormatError(path, problem, f"geometries[{flat[0]}]")
    return geometries


def _subregions(path: Path, layout: FeatureLayout, standard: Example) -> Subregions:
    height, width = standard.photo.shape[:2]
    if not path.exists():
        return default_subregions(layout, standard.points, (width, height))
    with ArrayFile(path) as arrays:
        names = arrays.texts("names")
        count = len(layout.names)
        members = tuple(arrays.whole(f"members/{n}", (None,), below=count) for n in names)
        fades = arrays.numbers("fades", (height, width, len(names)), most=2.0)
    try:
        return Subregions(names, fades.astype(np.float32), members)
    except InputError as error:
        raise FileFormatError(path, str(error)) from None


def _subregion_arrays(subregions: Subregions) -> dict[str, Any]:
    members = zip(subregions.names, subregions.members, strict=True)
    return {f"members/{name}": rows for name, rows in members} | {
        "names": np.array(subregions.names),
        "fades": subregions.fades,
    }


def _are_default(example_set: ExampleSet) -> bool:
    """Whether the subregions are those that mien draws, so that none need to be kept."""
    standard, ours = example_set.examples[example_set.standard], example_set.subregions
    height, width = standard.photo.shape[:2]
    default = default_subregions(example_set.layout, standard.points, (width, height))
    return (
        default.names == ours.names
        and np.array_equal(default.fades, ours.fades)
        and all(map(np.array_equal, default.members, ours.members))
    )


def _subregion_picture(subregions: Subregions) -> UInt8[Array, "h w 4"]:
    """The subregions in colours that blend as they do."""
    turn = np.arange(len(subregions.names)) * 2.4
    colours = 128 + 100 * np.cos(turn[:, None] + np.array([0, 2.1, 4.2]))
    total = subregions.fades.sum(axis=2, keepdims=True)
    mixed = subregions.fades @ colours.astype(np.float32) / np.maximum(total, 1e-6)
    return np.dstack([mixed, 255 * np.minimum(total, 1)]).round().astype(np.uint8)


def _write_png(path: Path, pixels: UInt8[Array, "h w c"]) -> None:
    path.write_bytes(encode_image(pixels, "PNG"))
