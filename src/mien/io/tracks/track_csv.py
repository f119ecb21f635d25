"""Tracks as files: TRACK.csv, a row a frame, and beside it TRACK.json, which says what they mean.

docs/reference/track-files.md describes both.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from mien.arrays import Array, Float, check_array
from mien.errors import FileFormatError
from mien.io.files.atomic import atomic_file
from mien.io.tracks.track_json import check_sidecar, load_sidecar, sidecar_of, sidecar_text
from mien.limits import MAX_FRAMES, MAX_SECONDS, UNIT_RANGE
from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.reading.csv_rows import finite_number, read_rows
from mien.track.state import STATUSES, Layout, Track, TrackedFrame, TrackState

FRAME = ("frame", "time", "status", "rms")
POSE = ("rx", "ry", "rz", "tx", "ty", "tz")
APPEARANCE = ("seen", *(f"{term}.{colour}" for term in ("gain", "bias") for colour in "rgb"))
DEVIATION = "sd."

_DIGITS = 10  # after the point
_SUM_TOLERANCE = 1e-6
_KIND = f"a track, whose first line starts with {','.join(FRAME)}"


def columns_of(layout: Layout) -> tuple[str, ...]:
    """The names of all columns of TRACK.csv, in their order."""
    deviations = (f"{DEVIATION}{channel}" for channel in layout.channels)
    return (*FRAME, *POSE, *layout.channels, *deviations, *APPEARANCE)


def check_track_place(path: str | Path) -> None:
    """Refuse, before any work is done, a name that save_track would not take.

    Raises:
        InputError: another suffix than .csv; a TRACK.json beside it that is no track's, such as a
            timeline of the same name.
    """
    check_sidecar(sidecar_of(path))


def save_track(path: str | Path, track: Track) -> None:
    """Write TRACK.csv and TRACK.json, each whole or not at all; load_track gives the track back.

    Numbers keep 1e-10. A number that is not finite becomes an empty cell, and so do all of a lost
    frame's but its frame and time.

    Raises:
        InputError: as check_track_place; a place that cannot be written; a frame whose numbers are
            not those of the layout.
    """
    check_track_place(path)
    # Both are written before either takes its place.
    with atomic_file(path) as table, atomic_file(sidecar_of(path)) as sidecar:
        with table.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns_of(track.layout))
            writer.writerows(_row(track.layout, frame) for frame in track.frames)
        sidecar.write_text(sidecar_text(track), encoding="utf-8")


def is_track(path: str | Path) -> bool:
    """Whether a file's first line is that of a TRACK.csv."""
    try:
        with Path(path).open("rb") as file:
            start = file.read(256)
    except OSError:
        return False
    return start.removeprefix(b"\xef\xbb\xbf").startswith(",".join(FRAME).encode())


def load_track(path: str | Path) -> Track:
    """The track in TRACK.csv and the TRACK.json beside it. An empty cell is NaN.

    Raises:
        InputError: a file that cannot be read, no TRACK.json.
        FileFormatError: names line and column, or the place in TRACK.json: another kind of file, a
            newer version, columns that do not follow from TRACK.json, a value that is no finite
            number, a status that is none, weights that do not sum to 1, frames that do not ascend.
    """
    path = Path(path)
    rows = read_rows(path, _KIND)
    line, header = next(rows)
    if tuple(header[: len(FRAME)]) != FRAME:
        found = ",".join(header)[:40]
        raise FileFormatError(path, f"expected {_KIND}, found {found!r}", f"line {line}")
    empty = load_sidecar(sidecar_of(path))
    columns = columns_of(empty.layout)
    _check_columns(path, header, columns)
    frames: list[TrackedFrame] = []
    for number, row in rows:
        cells = _Cells(path, number, columns, row)
        frames.append(_frame(cells, empty.layout))
        _check_order(cells, frames)
    return replace(empty, frames=tuple(frames))


def _check_order(cells: _Cells, frames: Sequence[TrackedFrame]) -> None:
    """Refuse the last frame where it is not after those before it, or too long after the first."""
    first, before, last = frames[0], frames[-2:][0], frames[-1]
    if len(frames) > 1 and last.frame <= before.frame:
        cells.refuse("frame", f"a number above {before.frame}", str(last.frame))
    if last.time < before.time:
        cells.refuse("time", f"{before.time:g} s or later", f"{last.time:g} s")
    if last.time - first.time > MAX_SECONDS - 1:
        cells.refuse("time", f"at most {MAX_SECONDS:g} s", f"{last.time:g} s")
    if len(frames) > MAX_FRAMES:
        cells.refuse("frame", f"at most {MAX_FRAMES} frames", "more")


@dataclass(frozen=True)
class _Cells:
    """One line of the table."""

    path: Path
    line: int
    columns: Sequence[str]
    row: Sequence[str]

    def __post_init__(self) -> None:
        if len(self.row) != len(self.columns):
            problem = f"expected {len(self.columns)} cells, found {len(self.row)}"
            raise FileFormatError(self.path, problem, f"line {self.line}")

    def text(self, column: str) -> str:
        return self.row[self.columns.index(column)].strip()

    def numbers(self, columns: Sequence[str], *, empty: bool = False) -> Float[Array, " n"]:
        """(N,) of columns beside each other. Args: empty: whether a cell may be; NaN then."""
        start = self.columns.index(columns[0]) if columns else 0
        texts = [text.strip() for text in self.row[start : start + len(columns)]]
        values = [
            math.nan if empty and not text else finite_number(self.path, text, self._place(column))
            for column, text in zip(columns, texts, strict=True)
        ]
        return np.array(values)

    def refuse(self, column: str, expected: str, found: str) -> NoReturn:
        """Raises: FileFormatError."""
        problem = f"expected {expected}, found {found[:40]}"
        raise FileFormatError(self.path, problem, self._place(column))

    def _place(self, column: str) -> str:
        return f"line {self.line}, {column}"


def _row(layout: Layout, frame: TrackedFrame) -> list[str]:
    known = [str(frame.frame), _cell(frame.time), frame.status]
    if frame.state is None:
        return known + [""] * (len(columns_of(layout)) - len(known))
    state = frame.state
    pose = [*_vector_of(state.R_cam_head), *state.t_cam_head]
    channels = len(layout.channels)
    values = check_array("state.values", state.values, (channels,))
    deviations = check_array("deviations", frame.deviations, (channels,), finite=False)
    appearance = [frame.seen, *frame.gain, *frame.bias]
    numbers = [frame.rms, *pose, *values, *deviations, *appearance]
    return known + [_cell(number) for number in numbers]


def _vector_of(rotation: Float[Array, "3 3"]) -> Float[Array, " 3"]:
    """The rotation vector with rx >= 0, of up to a whole turn.

    A head that faces the camera is turned by about pi about x. Of the two vectors for a rotation
    the shorter one would change its sign there from frame to frame; this one goes on smoothly.
    """
    vector = rotation_to_vector(rotation)
    if vector[0] < 0:
        vector = vector * (1 - 2 * np.pi / np.linalg.norm(vector))
    return vector


def _cell(number: float) -> str:
    if not math.isfinite(number):
        return ""
    # Adding 0 turns -0 into 0.
    return f"{round(float(number), _DIGITS) + 0.0:.{_DIGITS}f}".rstrip("0").rstrip(".")


def _frame(cells: _Cells, layout: Layout) -> TrackedFrame:
    number = cells.text("frame")
    if not (number.isascii() and number.isdigit() and len(number) <= 9):
        cells.refuse("frame", "a whole number", repr(number))
    status = cells.text("status")
    if status not in STATUSES:
        cells.refuse("status", f"one of {', '.join(STATUSES)}", repr(status))
    if status == "lost":
        _check_empty(cells)
    deviations = [f"{DEVIATION}{channel}" for channel in layout.channels]
    appearance = cells.numbers(APPEARANCE, empty=True)
    return TrackedFrame(
        frame=int(number),
        time=float(cells.numbers(("time",))[0]),
        status=status,
        state=_state(cells, layout) if status != "lost" else None,
        rms=float(cells.numbers(("rms",), empty=True)[0]),
        seen=float(appearance[0]),
        deviations=cells.numbers(deviations, empty=True),
        gain=appearance[1:4],
        bias=appearance[4:],
    )


def _check_empty(cells: _Cells) -> None:
    numbers = slice(FRAME.index("rms"), None)
    for column, text in zip(cells.columns[numbers], cells.row[numbers], strict=True):
        if text.strip():
            cells.refuse(column, "an empty cell in a lost frame", repr(text))


def _state(cells: _Cells, layout: Layout) -> TrackState:
    pose = cells.numbers(POSE)
    values = cells.numbers(layout.channels)
    count = len(layout.weight_channels)
    weights = np.ones((len(layout.regions), 1))
    if count:
        weights = values[:count].reshape(len(layout.regions), len(layout.expressions))
    for region, row in zip(layout.regions, weights, strict=True):
        if abs(row.sum() - 1) > _SUM_TOLERANCE:
            cells.refuse(region, "weights that sum to 1", f"{row.sum():g}")
    units = values[count : count + len(layout.units)]
    low, high = UNIT_RANGE
    for name, unit in zip(layout.units, units, strict=True):
        if not low <= unit <= high:
            cells.refuse(f"units.{name}", f"a weight from {low} to {high}", f"{unit:g}")
    return TrackState(
        R_cam_head=rotation_from_vector(pose[:3]),
        t_cam_head=pose[3:],
        weights=weights,
        units=units,
        gaze=values[count + len(layout.units) :],
    )


def _check_columns(path: Path, header: Sequence[str], columns: Sequence[str]) -> None:
    for found, expected in zip(header, columns, strict=False):
        if found.strip() != expected:
            problem = f"expected the column {expected!r}, found {found[:40]!r}"
            raise FileFormatError(path, problem, "line 1")
    if len(header) != len(columns):
        problem = f"expected {len(columns)} columns, found {len(header)}"
        raise FileFormatError(path, problem, "line 1")
