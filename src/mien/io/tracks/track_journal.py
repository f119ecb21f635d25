"""The journal of an unfinished run: what is tracked is kept, so that a killed run can go on.

JSON lines beside the output: a header, then a frame a line, added as they come. Numbers are written
so that they read back bit for bit.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TextIO, cast

import numpy as np

from mien.arrays import Array, Float
from mien.errors import FileFormatError, InputError
from mien.io.files.atomic import atomic_file
from mien.limits import MAX_LINE, MAX_TABLE_BYTES
from mien.reading.files import check_size
from mien.reading.strict_json import (
    DocumentFormat,
    JsonValue,
    errors_name_file,
    join,
    parse_json,
)
from mien.track.state import STATUSES, Layout, Status, TrackedFrame, TrackState

JOURNAL_FORMAT = DocumentFormat("mien track journal", 1)
FLUSH_SECONDS = 0.5
"""A killed run loses the frames of this time, and the one it was at."""

_FRAME = ("frame", "time", "status", "state", "rms", "seen", "deviations", "gain", "bias")
_STATE = ("R_cam_head", "t_cam_head", "weights", "weights_shape", "units", "gaze")

Json = dict[str, Any]


def journal_of(output: str | Path) -> Path:
    """Where the journal of a run is: `TRACK.csv.part` beside `TRACK.csv`."""
    output = Path(output)
    return output.with_name(f"{output.name}.part")


class Journal:
    """An open journal; frames are added at its end.

    Leaving its `with` block closes it and keeps the file: a run that fails can go on, too. `remove`
    when the result is written.

    Attributes:
        path: the file.
    """

    def __init__(self, path: Path, file: TextIO, clock: Callable[[], float]) -> None:
        self.path, self._file, self._clock = path, file, clock
        self._flushed = clock()

    @classmethod
    def start(
        cls,
        path: str | Path,
        header: Mapping[str, Any],
        frames: Sequence[TrackedFrame] = (),
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> Journal:
        """A new journal in the place of an older one.

        Args:
            path: the file.
            header: what the frames follow from (video, head, options), as JSON has it; a run with
                another one must not go on from here.
            frames: those of the journal that this one continues.
            clock: seconds.

        Raises:
            InputError: a place that cannot be written.
        """
        path = Path(path)
        top = JOURNAL_FORMAT.header | {"run": header}
        with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
            file.write(json.dumps(top) + "\n")
            file.writelines(_line_of(frame) for frame in frames)
        with _writing(path):
            return cls(path, path.open("a", encoding="utf-8", newline="\n"), clock)

    def append(self, frame: TrackedFrame) -> None:
        """Add a frame; it is on its way to the disk within FLUSH_SECONDS of frames.

        Raises:
            InputError: the place cannot be written any more.
        """
        with _writing(self.path):
            self._file.write(_line_of(frame))
            if self._clock() - self._flushed >= FLUSH_SECONDS:
                self._file.flush()
                self._flushed = self._clock()

    def close(self) -> None:
        """Write what is left and keep the file. Raises: InputError: as append."""
        with _writing(self.path):
            self._file.close()

    def remove(self) -> None:
        """Close it and delete the file. Raises: InputError: as append."""
        self.close()
        self.path.unlink(missing_ok=True)

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def load_journal(
    path: str | Path, header: Mapping[str, Any], layout: Layout
) -> tuple[TrackedFrame, ...]:
    """The frames that an unfinished run has kept; a last line that was cut off is left out.

    Args:
        path: the file.
        header: of the run that wants to go on.
        layout: of its frames.

    Raises:
        InputError: the file cannot be read; another run's journal: names what differs.
        FileFormatError: no journal, a newer version; a line that holds no frame, or another one
            than that which follows.
    """
    path = check_size(path, MAX_TABLE_BYTES)
    frames: list[TrackedFrame] = []
    try:
        with path.open("rb") as file:
            lines = _whole_lines(file)
            _check_header(path, next(lines, b""), json.loads(json.dumps(header)))
            for number, line in enumerate(lines, 2):
                data = _parsed(path, number, line, "a frame of a track")
                with errors_name_file(path, line=number):
                    frames.append(_frame(JsonValue(data), layout, frames))
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    return tuple(frames)


def _whole_lines(file: BinaryIO) -> Iterator[bytes]:
    """Every line but what follows the last line break: that was being written, or is nothing."""
    for line in file:
        if line.endswith(b"\n"):
            yield line


def _parsed(path: Path, number: int, line: bytes, expected: str) -> Json:
    """Raises: FileFormatError: no object, too long."""
    if len(line) > MAX_LINE:
        problem = f"expected lines of at most {MAX_LINE} letters, found {len(line)}"
        raise FileFormatError(path, problem, f"line {number}")
    try:
        data = parse_json(path, line.decode("utf-8"), line=number)
    except UnicodeDecodeError:
        data = None
    if not isinstance(data, dict):
        problem = f"expected {expected}, found {line[:40].decode(errors='replace')!r}"
        raise FileFormatError(path, problem, f"line {number}")
    return data


def _check_header(path: Path, line: bytes, run: Json) -> None:
    top = _parsed(path, 1, line or b"null", "the journal of an unfinished track")
    with errors_name_file(path, line=1):
        JOURNAL_FORMAT.check(JsonValue(top))
    for place, kept, wanted in _differences(top.get("run"), run):
        raise InputError(path, f"an unfinished run with {place} = {wanted}", f"one with {kept}")


def _differences(kept: Any, wanted: Any, place: str = "") -> Iterator[tuple[str, str, str]]:
    """Where two headers differ, and both values there."""
    if isinstance(kept, dict) and isinstance(wanted, dict):
        for key in dict.fromkeys((*wanted, *kept)):
            yield from _differences(kept.get(key), wanted.get(key), join(place, key))
    elif kept != wanted:
        yield place, json.dumps(kept)[:60], json.dumps(wanted)[:60]


def _line_of(frame: TrackedFrame) -> str:
    data = {
        "frame": int(frame.frame),
        "time": float(frame.time),
        "status": frame.status,
        "state": None if frame.state is None else _state_to_json(frame.state),
        "rms": float(frame.rms),
        "seen": float(frame.seen),
        "deviations": _numbers(frame.deviations),
        "gain": _numbers(frame.gain),
        "bias": _numbers(frame.bias),
    }
    return json.dumps(data, separators=(",", ":")) + "\n"


def _state_to_json(state: TrackState) -> Json:
    return {
        "R_cam_head": _numbers(state.R_cam_head),
        "t_cam_head": _numbers(state.t_cam_head),
        "weights": _numbers(state.weights),
        "weights_shape": list(state.weights.shape),
        "units": _numbers(state.units),
        "gaze": _numbers(state.gaze),
    }


def _numbers(array: Array) -> list[float]:
    return np.asarray(array, dtype=np.float64).ravel().tolist()


def _frame(data: JsonValue, layout: Layout, before: Sequence[TrackedFrame]) -> TrackedFrame:
    """The frame that follows those before it. Raises: DocumentError, InputError."""
    data.members(_FRAME)
    index = data["frame"].whole(least=0)
    if index != len(before):
        raise data["frame"].error(f"expected {len(before)}, found {index}")
    seconds = data["time"].number()
    if before and seconds < (earliest := before[-1].time):
        raise data["time"].error(f"expected {earliest:g} s or later, found {seconds:g} s")
    status, state = data["status"].choice("status", STATUSES), data["state"]
    found, channels = state.raw is not None, len(layout.channels)
    if found == (status == "lost"):
        expected = "none" if state.raw else "one"
        raise state.error(f"expected {expected} of a frame that is {status}")
    gain, bias = (_floats(data[key], 3, finite=found) for key in ("gain", "bias"))
    pair = JsonValue([data["rms"].raw, data["seen"].raw], "rms")
    rms, seen = _floats(pair, 2, finite=found)
    return TrackedFrame(
        frame=index,
        time=seconds,
        status=cast(Status, status),
        state=_state_from_json(state, layout) if found else None,
        rms=float(rms),
        seen=float(seen),
        deviations=_floats(data["deviations"], channels, finite=False),
        gain=gain,
        bias=bias,
    )


def _state_from_json(data: JsonValue, layout: Layout) -> TrackState:
    data.members(_STATE)
    shape = (len(layout.regions), len(layout.expressions))
    stated = data["weights_shape"]
    if stated.raw != list(shape):
        raise stated.error(f"expected {list(shape)}, found {str(stated.raw)[:40]}")
    counts = {"R_cam_head": 9, "t_cam_head": 3, "weights": shape[0] * shape[1]}
    counts |= {"units": len(layout.units), "gaze": 2}
    arrays = {name: _floats(data[name], count, finite=True) for name, count in counts.items()}
    arrays |= {
        "R_cam_head": arrays["R_cam_head"].reshape(3, 3),
        "weights": arrays["weights"].reshape(shape),
    }
    return TrackState(**arrays)


def _floats(value: JsonValue, count: int, *, finite: bool) -> Float[Array, " n"]:
    """(count,) numbers; NaN among them unless they must be finite. Raises: DocumentError."""
    items = value.items()
    if len(items) != count:
        raise value.error(f"expected {count} numbers, found {len(items)}")
    for item in items:
        if finite or item.raw == item.raw:
            item.number()
    return np.array(value.raw, dtype=np.float64)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise InputError(path, "a place that can be written to", reason) from error
