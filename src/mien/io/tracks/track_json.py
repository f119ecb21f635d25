"""TRACK.json: what the numbers in the TRACK.csv beside it mean."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

from mien.errors import InputError
from mien.limits import MAX_FPS, MAX_PHOTO_SIDE, MIN_FPS
from mien.reading.strict_json import DocumentFormat, JsonValue, errors_name_file, read_json
from mien.track.state import Layout, Track

TRACK_FORMAT = DocumentFormat("mien track", 1)


def sidecar_of(path: str | Path) -> Path:
    """TRACK.json beside TRACK.csv. Raises: InputError: a name that does not end in .csv."""
    path = Path(path)
    if path.suffix.lower() != ".csv":
        raise InputError(path, "a name that ends in .csv", path.suffix or "no suffix")
    return path.with_suffix(".json")


def check_sidecar(path: Path) -> None:
    """Refuse to write over a file that is no track's, such as a timeline of the same name.

    Raises:
        InputError: names the file.
    """
    if path.exists() and not TRACK_FORMAT.is_in(path):
        expected = "no file of this name, or that of an older track: it goes with the .csv"
        raise InputError(path, expected, "another file")


def sidecar_text(track: Track) -> str:
    """The contents of TRACK.json."""
    layout = track.layout
    data = {
        **TRACK_FORMAT.header,
        "generator": f"mien {version('mien')}",
        "width": track.width,
        "height": track.height,
        "focal_px": float(track.focal_px),
        "fps": float(track.fps),
        "regions": list(layout.regions),
        "expressions": list(layout.expressions),
        "units": list(layout.units),
    }
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def load_sidecar(path: Path) -> Track:
    """A track without frames.

    Raises:
        InputError: no such file.
        FileFormatError: not a track's, a newer version, a key that is missing or holds something
            else.
    """
    if not path.exists():
        expected = "the file that goes with the .csv and says what its numbers mean"
        raise InputError(path, expected, "no such file")
    data = JsonValue(read_json(path))
    with errors_name_file(path):
        TRACK_FORMAT.check(data)
        width, height = (
            data[key].whole(above=0, most=MAX_PHOTO_SIDE) for key in ("width", "height")
        )
        focal_px = data["focal_px"].number(above=0)
        fps = data["fps"].number(least=MIN_FPS, most=MAX_FPS)
        layout = Layout(*(data[key].names() for key in ("regions", "expressions", "units")))
    return Track(layout, width, height, focal_px, fps, ())
