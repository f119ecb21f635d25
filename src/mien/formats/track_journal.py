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
from types import TracebackType
from typing import Any, TextIO

import numpy as np

from mien.arrays import Array
from mien.errors import Broken, FileFormatError, InputError
from mien.formats.atomic import atomic_file
from mien.strict_json import check_format, join
from mien.track.state import TrackedFrame, TrackState

FORMAT = "mien track journal"
VERSION = 1
FLUSH_SECONDS = 0.5
"""A killed run loses the frames of this time, and the one it was at."""

Json = dict[str, Any]


def journal_of(output: str | Path) -> Path:
    """Where the journal of a run is: `TRACK.csv.part` beside `TRACK.csv`."""
    output = Path(output)
    return output.with_name(f"{output.name}.part")


class Journal:
    """An open journal; frames are added at its end.

    Leaving its `with` block closes it and keeps the file: a run that fails can go on, too. `remove`
    when the result is written.
    """

    def __init__(self, path: Path, file: TextIO, clock: Callable[[], float]) -> None:
        self._path, self._file, self._clock = path, file, clock
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
            header: what the frames follow from (video, head, options), as JSON has it; a run with
                another one must not go on from here.
            frames: those of the journal that this one continues.
            clock: seconds.
        Raises: InputError: a place that cannot be written.
        """
        path = Path(path)
        top = {"format": FORMAT, "version": VERSION, "run": header}
        with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
            file.write(json.dumps(top) + "\n")
            file.writelines(_line_of(frame) for frame in frames)
        with _writing(path):
            return cls(path, path.open("a", encoding="utf-8", newline="\n"), clock)

    def append(self, frame: TrackedFrame) -> None:
        """Add a frame; it is on its way to the disk within FLUSH_SECONDS of frames.

        Raises: InputError: the place cannot be written any more.
        """
        with _writing(self._path):
            self._file.write(_line_of(frame))
            if self._clock() - self._flushed >= FLUSH_SECONDS:
                self._file.flush()
                self._flushed = self._clock()

    def close(self) -> None:
        """Write what is left and keep the file. Raises: InputError: as append."""
        with _writing(self._path):
            self._file.close()

    def remove(self) -> None:
        """Close it and delete the file. Raises: InputError: as append."""
        self.close()
        self._path.unlink(missing_ok=True)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def load_journal(path: str | Path, header: Mapping[str, Any]) -> tuple[TrackedFrame, ...]:
    """The frames that an unfinished run has kept; a last line that was cut off is left out.

    Args:
        header: of the run that wants to go on.
    Raises:
        InputError: the file cannot be read; another run's journal: names what differs.
        FileFormatError: no journal, a newer version, a line that holds no frame.
    """
    path = Path(path)
    try:
        # What follows the last line break is what was being written, or nothing.
        lines = path.read_bytes().split(b"\n")[:-1]
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or error) from None
    _check_header(path, lines[0] if lines else b"", json.loads(json.dumps(header)))
    return tuple(_frame(path, number, line) for number, line in enumerate(lines[1:], 2))


def _check_header(path: Path, line: bytes, run: Json) -> None:
    try:
        top = json.loads(line)
        check_format(top, FORMAT, VERSION)
    except Broken as broken:
        raise FileFormatError(path, broken.problem, broken.place) from None
    except (ValueError, AttributeError):
        raise FileFormatError(path, "expected the journal of an unfinished track") from None
    different = next(_differences(top.get("run"), run), None)
    if different:
        place, kept, wanted = different
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
    numbers: list[float] = np.asarray(array, dtype=np.float64).ravel().tolist()
    return numbers


def _frame(path: Path, number: int, line: bytes) -> TrackedFrame:
    try:
        data = json.loads(line)
        return TrackedFrame(
            frame=data["frame"],
            time=data["time"],
            status=data["status"],
            state=None if data["state"] is None else _state_from_json(data["state"]),
            rms=data["rms"],
            seen=data["seen"],
            deviations=np.array(data["deviations"]),
            gain=np.array(data["gain"]),
            bias=np.array(data["bias"]),
        )
    except (ValueError, KeyError, TypeError):
        problem = f"expected a frame of a track, found {line[:40].decode(errors='replace')!r}"
        raise FileFormatError(path, problem, f"line {number}") from None


def _state_from_json(data: Json) -> TrackState:
    return TrackState(
        R_cam_head=np.reshape(data["R_cam_head"], (3, 3)),
        t_cam_head=np.array(data["t_cam_head"]),
        weights=np.reshape(data["weights"], data["weights_shape"]),
        units=np.array(data["units"]),
        gaze=np.array(data["gaze"]),
    )


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise InputError(path, "a place that can be written to", reason) from error
