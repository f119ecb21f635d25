"""Live Link Face CSV: what the app records and plug-ins of Unreal, Blender and Maya read.

A row a frame: timecode, how many numbers follow, 52 face units (`EyeBlinkLeft`), angles of head and
eyes (mien.io.live.live_link).
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mien.animate.channels import head_angles_rad
from mien.animate.curves import MIN_STEP, Curve, sampled
from mien.animate.timeline import Moment, Timeline
from mien.arrays import Array, Float
from mien.errors import FileFormatError, InputError
from mien.io.files.atomic import atomic_file
from mien.io.live.live_link import (
    EYE_COLUMNS,
    HEAD_COLUMNS,
    TIMECODE_RATE,
    UNITS,
    column_name,
    live_link_values,
)
from mien.limits import MAX_FPS, MAX_FRAMES, MAX_GAP_SECONDS, MAX_SECONDS, MIN_FPS, UNIT_RANGE
from mien.reading.csv_rows import finite_number, read_rows
from mien.rig.state import FaceState

TIMECODE_COLUMN, COUNT_COLUMN = "Timecode", "BlendShapeCount"

_TIMECODE = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})[:;](\d{1,3}(?:[.,]\d{1,9})?)", re.ASCII)
_SEPARATORS = ",;\t"
_OPTIONAL = frozenset(("tongueout",))
_DAY = 24 * 3600
_HEADER = (
    f"a Live Link Face recording, whose first line starts with {TIMECODE_COLUMN},{COUNT_COLUMN}"
)
_SPARSE_SECONDS = 0.1
"""Rows farther apart than this show no speech, which is worth a note."""
_PERCENT, _DEGREES = 100.0, 360.0
_TURN = 2 * math.pi


def save_live_link(
    path: str | Path,
    moments: Iterable[Moment],
    *,
    units_of: Callable[[FaceState], Mapping[str, float]] = lambda state: state.units,
) -> int:
    """Write a performance as a Live Link Face CSV, whole or not at all.

    The format has no photographed expressions and no position of the head: only units, head and
    eye angles are written. Where the eyes look is added to the EyeLook units, which is what most
    programs read.

    Args:
        path: the file.
        moments: in rising time, from 0 s on.
        units_of: weights by unit for a face state; its own units unless given, which leave out
            photographed expressions.

    Returns:
        how many frames were written.

    Raises:
        InputError: no moment, a unit that the format has no column for, a negative time, a place
            that cannot be written.
    """
    count = 0
    header = [TIMECODE_COLUMN, COUNT_COLUMN, *map(column_name, UNITS), *HEAD_COLUMNS, *EYE_COLUMNS]
    with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for moment in moments:
            writer.writerow(_row(moment, units_of(moment.state)))
            count += 1
        if not count:
            raise InputError(path, "at least one frame to write", "none")
    return count


def load_live_link(path: str | Path, *, timecode_rate: float | None = None) -> Timeline:
    """A recording as a timeline with a key for every frame.

    Columns are found by name, in any order and case; TongueOut and the head's angles may be
    missing, others are ignored (the eyes' angles too: the EyeLook units say the same). Cells may be
    separated by commas, semicolons or tabs, decimals by commas. Frames without values, which the
    app writes where it lost the face, are bridged by their neighbours; of rows with one timecode
    the first counts. The timeline's notes tell of these, and of rows that are far apart.

    Args:
        path: the file.
        timecode_rate: frames a second that the timecodes count; found from where they start again
            unless given, and the app's 60 where they never do.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: names line and column: another kind of file, a unit that is missing or
            twice there, a value that is no finite number or beyond UNIT_RANGE, times that do not
            rise or leave a gap of more than MAX_GAP_SECONDS, no frame, more than MAX_FRAMES.
    """
    path = Path(path)
    rows = read_rows(path, _HEADER, separators=_SEPARATORS)
    line, header = next(rows)
    columns = _columns(path, header, line)
    names = _value_names(columns)
    stamps: list[tuple[int, float]] = []
    values, lines, doubled = [], [], 0
    for line, row in rows:
        if _is_lost(row, columns):
            continue
        _check_width(path, line, row, len(header))
        stamp = _stamp(path, line, _cell(row, columns[TIMECODE_COLUMN.lower()]))
        if stamps and stamp == stamps[-1]:
            doubled += 1
            continue
        stamps.append(stamp)
        values.append(np.array([_number(path, line, name, row, columns) for name in names]))
        lines.append(line)
        if len(lines) > MAX_FRAMES:
            raise FileFormatError(path, f"expected at most {MAX_FRAMES} frames", f"line {line}")
    if not values:
        raise FileFormatError(path, "expected frames, found none with values")
    rate = timecode_rate or _rate(stamps)
    times = _times(path, stamps, lines, rate)
    timeline = _timeline(times, dict(zip(names, np.array(values).T, strict=True)))
    return replace(timeline, notes=tuple(_notes(path, times, doubled)))


def timecode(seconds: float) -> str:
    """HH:MM:SS:FF.sss with TIMECODE_RATE frames a second. Raises: InputError: negative."""
    if not seconds >= 0:
        raise InputError("time", "a frame at 0 s or later", f"{seconds:g} s")
    total, thousandths = divmod(round(seconds * TIMECODE_RATE * 1000), 1000)
    whole, frame = divmod(total, TIMECODE_RATE)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours:02}:{minutes:02}:{whole % 60:02}:{frame:02}.{thousandths:03}"


def _row(moment: Moment, given: Mapping[str, float]) -> list[str]:
    # Adding 0 turns -0 into 0.
    numbers = [f"{value + 0.0:.10f}" for value in live_link_values(moment, given).values()]
    return [timecode(moment.time), str(len(numbers)), *numbers]


def _notes(path: Path, times: Array, doubled: int) -> Iterator[str]:
    if doubled:
        rows = "a row repeats" if doubled == 1 else f"{doubled} rows repeat"
        yield f"{path.name}: {rows} the timecode of the row before; the first of them counts"
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if step > _SPARSE_SECONDS:
        yield f"{path.name}: a row every {step:.3g} s; what the face did in between is not in it"


def _columns(path: Path, header: Sequence[str], line: int) -> dict[str, int]:
    """Where each column is, by its name in lower case."""
    place = f"line {line}"
    names = [name.strip().lower() for name in header]
    if TIMECODE_COLUMN.lower() not in names:
        raise FileFormatError(path, f"expected {_HEADER}, found {','.join(header)[:40]!r}", place)
    counts = Counter(filter(None, names))
    for name, count in counts.items():
        if count > 1:
            raise FileFormatError(path, f"the column {name[:40]!r} appears twice", place)
    missing = [u for u in UNITS if u.lower() not in names and u.lower() not in _OPTIONAL]
    if missing:
        others = f" and {len(missing) - 1} others" if len(missing) > 1 else ""
        problem = f"no column for the face unit {missing[0]}{others}"
        raise FileFormatError(path, problem, place)
    return {name: index for index, name in enumerate(names)}


def _check_width(path: Path, line: int, row: Sequence[str], width: int) -> None:
    """Raises: FileFormatError: cells beyond the columns, as decimal commas make them."""
    if any(cell.strip() for cell in row[width:]):
        problem = f"expected {width} cells, found {len(row)}: decimal commas between commas?"
        raise FileFormatError(path, problem, f"line {line}")


def _value_names(columns: dict[str, int]) -> tuple[str, ...]:
    return tuple(name for name in (*UNITS, *HEAD_COLUMNS) if name.lower() in columns)


def _is_lost(row: Sequence[str], columns: dict[str, int]) -> bool:
    """A frame in which the app saw no face: a count of 0, nothing after it."""
    count = _cell(row, columns.get(COUNT_COLUMN.lower(), len(row)))
    return count == "0" or (len(row) > 1 and not any(cell.strip() for cell in row[2:]))


def _cell(row: Sequence[str], index: int) -> str:
    return row[index].strip() if index < len(row) else ""


def _stamp(path: Path, line: int, text: str) -> tuple[int, float]:
    """Whole seconds, and frames since then."""
    match = _TIMECODE.fullmatch(text)
    if match is None or int(match[2]) > 59 or int(match[3]) > 59:
        problem = f"expected HH:MM:SS:FF.sss, found {text[:40]!r}"
        raise FileFormatError(path, problem, f"line {line}, {TIMECODE_COLUMN}")
    seconds = (int(match[1]) * 60 + int(match[2])) * 60 + int(match[3])
    return seconds, float(match[4].replace(",", "."))


def _number(path: Path, line: int, name: str, row: Sequence[str], columns: dict[str, int]) -> float:
    """The weight of a unit, or an angle in radians."""
    place = f"line {line}, {name[:1].upper()}{name[1:]}"
    text = _cell(row, columns[name.lower()])
    value = finite_number(path, text if "." in text else text.replace(",", "."), place)
    low, high = (-_TURN, _TURN) if name in HEAD_COLUMNS else UNIT_RANGE
    if low <= value <= high:
        return value
    angle = name in HEAD_COLUMNS
    asked = "angles in degrees? " if angle else "weights in percent? "
    question = asked if abs(value) <= (_DEGREES if angle else _PERCENT) else ""
    problem = f"{value:g}: {question}expected a number from {low:.3g} to {high:.3g}"
    raise FileFormatError(path, problem, place)


def _rate(stamps: Sequence[tuple[int, float]]) -> float:
    """Frames a second of the timecodes: how far they get before they start again."""
    seconds, frames = np.array(stamps).T
    steps, advance = np.diff(frames), np.diff(seconds)
    within, across = steps[advance == 0], steps[advance == 1]
    if not (len(within) and len(across)):
        return TIMECODE_RATE
    rate = float(np.round(np.median(np.median(within) - across)))
    return rate if rate >= max(1.0, frames.max() - 1) else TIMECODE_RATE


def _times(
    path: Path, stamps: Sequence[tuple[int, float]], lines: Sequence[int], rate: float
) -> Float[Array, " n"]:
    """(N,) seconds since the first frame."""
    seconds, frames = np.array(stamps).T
    times = seconds + frames / rate
    # Past midnight the clock starts again.
    times = times + _DAY * np.cumsum(np.append(0, np.diff(times) < -_DAY / 2))
    elapsed: Array = times - times[0]
    steps = np.diff(elapsed)
    for wrong, problem in (
        (steps < MIN_STEP, "expected a time after that of the frame before"),
        (
            steps > MAX_GAP_SECONDS,
            f"expected a time at most {MAX_GAP_SECONDS:g} s after the frame before",
        ),
        (elapsed[1:] > MAX_SECONDS - 1, f"expected at most {MAX_SECONDS:g} s"),
    ):
        if len(found := np.flatnonzero(wrong)):
            index = int(found[0]) + 1
            raise FileFormatError(path, problem, f"line {lines[index]}, {TIMECODE_COLUMN}")
    return elapsed


def _timeline(times: Array, values: dict[str, Array]) -> Timeline:
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1 / TIMECODE_RATE
    tracks: dict[str, Curve] = {
        f"units.{name}": sampled(times, values[name])
        for name in UNITS
        if name in values and values[name].any()
    }
    tracks |= _head_tracks(times, [values.get(name) for name in HEAD_COLUMNS])
    fps = min(max(round(1 / step, 3), MIN_FPS), MAX_FPS)
    # A last frame that lasts seconds would only be a still picture.
    return Timeline(float(times[-1]) + min(step, 1.0), fps=fps, tracks=tracks)


def _head_tracks(times: Array, angles: Sequence[Array | None]) -> dict[str, Curve]:
    from scipy.spatial.transform import Rotation

    given = [angle for angle in angles if angle is not None]
    if len(given) < len(angles) or not np.any(given):
        return {}
    yaw_pitch_roll = np.column_stack([-given[0], given[1], -given[2]])
    rotations = Rotation.from_euler("YXZ", yaw_pitch_roll).as_matrix()
    unwrapped = np.unwrap(np.array([head_angles_rad(rotation) for rotation in rotations]), axis=0)
    return {
        f"head.{name}": sampled(times, unwrapped[:, index])
        for index, name in enumerate(("yaw", "pitch", "roll"))
    }
