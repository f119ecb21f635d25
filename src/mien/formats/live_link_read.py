"""Live Link Face CSV in: a recording as a timeline."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mien.animate.channels import head_angles
from mien.animate.curves import Curve, sampled
from mien.animate.timeline import Timeline
from mien.arrays import Array, Float
from mien.errors import FileFormatError
from mien.formats.csv_rows import finite_number, read_rows
from mien.formats.live_link import COUNT, HEAD_COLUMNS, TIMECODE, TIMECODE_RATE, UNITS

_TIMECODE = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})[:;](\d{1,3}(?:\.\d+)?)", re.ASCII)
_OPTIONAL = frozenset(("tongueout",))
_DAY = 24 * 3600
_HEADER = f"a Live Link Face recording, whose first line starts with {TIMECODE},{COUNT}"


def load_live_link(path: str | Path, *, timecode_rate: float | None = None) -> Timeline:
    """A recording as a timeline with a key for every frame.

    Columns are found by name, in any order and case; TongueOut and the head's angles may be
    missing, others are ignored (the eyes' angles too: the EyeLook units say the same). Frames
    without values, which the app writes where it lost the face, are bridged by their neighbours.

    Args:
        timecode_rate: frames a second that the timecodes count; found from where they start again
            unless given, and the app's 60 where they never do.
    Raises:
        InputError: the file cannot be read.
        FileFormatError: names line and column: another kind of file, a unit that is missing or
            twice there, a value that is no finite number, times that do not rise, no frame.
    """
    path = Path(path)
    rows = read_rows(path, _HEADER)
    columns = _columns(path, rows[0])
    stamps, values, lines = [], [], []
    for line, row in enumerate(rows[1:], start=2):
        if _is_lost(row, columns):
            continue
        stamps.append(_stamp(path, line, _cell(row, columns[TIMECODE.lower()])))
        values.append([_number(path, line, name, row, columns) for name in _value_names(columns)])
        lines.append(line)
    if not values:
        raise FileFormatError(path, "expected frames, found none with values")
    rate = timecode_rate or _rate(stamps)
    times = _times(path, stamps, lines, rate)
    return _timeline(times, dict(zip(_value_names(columns), np.array(values).T, strict=True)))


def _columns(path: Path, header: Sequence[str]) -> dict[str, int]:
    """Where each column is, by its name in lower case."""
    names = [name.strip().lower() for name in header]
    if TIMECODE.lower() not in names:
        raise FileFormatError(
            path, f"expected {_HEADER}, found {','.join(header)[:40]!r}", "line 1"
        )
    for name in names:
        if name and names.count(name) > 1:
            raise FileFormatError(path, f"the column {name!r} appears twice", "line 1")
    missing = [u for u in UNITS if u.lower() not in names and u.lower() not in _OPTIONAL]
    if missing:
        others = f" and {len(missing) - 1} others" if len(missing) > 1 else ""
        problem = f"no column for the face unit {missing[0]}{others}"
        raise FileFormatError(path, problem, "line 1")
    return {name: index for index, name in enumerate(names)}


def _value_names(columns: dict[str, int]) -> tuple[str, ...]:
    return tuple(name for name in (*UNITS, *HEAD_COLUMNS) if name.lower() in columns)


def _is_lost(row: Sequence[str], columns: dict[str, int]) -> bool:
    """An empty line, or a frame in which the app saw no face: a count of 0, nothing after it."""
    if not any(cell.strip() for cell in row):
        return True
    told = _cell(row, columns.get(COUNT.lower(), len(row)))
    return told == "0" or (len(row) > 1 and not any(cell.strip() for cell in row[2:]))


def _cell(row: Sequence[str], index: int) -> str:
    return row[index].strip() if index < len(row) else ""


def _stamp(path: Path, line: int, text: str) -> tuple[int, float]:
    """Whole seconds, and frames since then."""
    match = _TIMECODE.fullmatch(text)
    if match is None or int(match[2]) > 59 or int(match[3]) > 59:
        problem = f"expected HH:MM:SS:FF.sss, found {text[:40]!r}"
        raise FileFormatError(path, problem, f"line {line}, {TIMECODE}")
    return (int(match[1]) * 60 + int(match[2])) * 60 + int(match[3]), float(match[4])


def _number(path: Path, line: int, name: str, row: Sequence[str], columns: dict[str, int]) -> float:
    place = f"line {line}, {name[:1].upper()}{name[1:]}"
    return finite_number(path, _cell(row, columns[name.lower()]), place)


def _rate(stamps: Sequence[tuple[int, float]]) -> float:
    """Frames a second of the timecodes: how far they get before they start again."""
    seconds, frames = np.array(stamps).T
    steps, advance = np.diff(frames), np.diff(seconds)
    within, across = steps[advance == 0], steps[advance == 1]
    if not (len(within) and len(across)):
        return TIMECODE_RATE
    rate = float(np.median(np.median(within) - across))
    return float(round(rate)) if rate > frames.max() - 1 else TIMECODE_RATE


def _times(
    path: Path, stamps: Sequence[tuple[int, float]], lines: Sequence[int], rate: float
) -> Float[Array, " n"]:
    """(N,) seconds since the first frame."""
    seconds, frames = np.array(stamps).T
    times = seconds + frames / rate
    # Past midnight the clock starts again.
    times = times + _DAY * np.cumsum(np.append(0, np.diff(times) < -_DAY / 2))
    falls = np.flatnonzero(np.diff(times) <= 0)
    if len(falls):
        index = int(falls[0]) + 1
        problem = "expected a time after that of the frame before"
        raise FileFormatError(path, problem, f"line {lines[index]}, {TIMECODE}")
    elapsed: Array = times - times[0]
    return elapsed


def _timeline(times: Array, values: dict[str, Array]) -> Timeline:
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1 / TIMECODE_RATE
    tracks: dict[str, Curve] = {
        f"units.{name}": sampled(times, values[name])
        for name in UNITS
        if name in values and values[name].any()
    }
    tracks |= _head_tracks(times, [values.get(name) for name in HEAD_COLUMNS])
    return Timeline(float(times[-1]) + step, fps=round(1 / step, 3), tracks=tracks)


def _head_tracks(times: Array, angles: Sequence[Array | None]) -> dict[str, Curve]:
    from scipy.spatial.transform import Rotation

    there = [angle for angle in angles if angle is not None]
    if len(there) < len(angles) or not np.any(there):
        return {}
    turned = np.column_stack([-there[0], there[1], -there[2]])
    rotations = Rotation.from_euler("YXZ", turned).as_matrix()
    ours = np.unwrap(np.array([head_angles(rotation) for rotation in rotations]), axis=0)
    return {
        f"head.{name}": sampled(times, ours[:, index])
        for index, name in enumerate(("yaw", "pitch", "roll"))
    }
