"""What running mien's command line in this process gives."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from mien.pipelines.build import Build
from mien.render.picture import turntable_frames

FAST = ("--texture-size", "256")
SHORT_TURNTABLE = partial(turntable_frames, frames=4, size=(120, 150))


@dataclass(frozen=True)
class Ran:
    """What a command left on the terminal."""

    status: int
    out: str
    err: str

    @property
    def error(self) -> str:
        """The one line of a command that failed as it should, without `error: `."""
        assert self.status == 2
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("error: ")
        line = lines[0].removeprefix("error: ")
        # With --json, the same as an object; else nothing.
        assert self.out == "" or json.loads(self.out)["error"]["message"] == line
        return line

    @property
    def json(self) -> dict[str, Any]:
        """The one object that `--json` prints, nothing beside it."""
        assert self.status == 0, self.err
        assert self.err == ""
        data = json.loads(self.out)
        assert isinstance(data, dict)
        return data


Mien = Callable[..., Ran]


@dataclass(frozen=True)
class Built:
    """A head folder, what it was built from, what came of it and what the command said."""

    source: Path
    folder: Path
    result: Build
    summary: dict[str, Any]
