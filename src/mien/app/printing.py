"""What commands print in the end, as text or as JSON."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from mien.errors import escaped

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout, no bars.")]


def print_result(
    as_json: bool, data: dict[str, Any], text: str, notes: tuple[str, ...] = ()
) -> None:
    """The result on stdout; notes, which the JSON has in it, on stderr."""
    print(json.dumps(_escaped_within(data), indent=2) if as_json else escaped(text))
    for note in () if as_json else notes:
        print("note:", escaped(note), file=sys.stderr)


def set_up_streams() -> None:
    """From here on, no character stops a line: what a terminal cannot show is escaped."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _escaped_within(data: Any) -> Any:
    if isinstance(data, str):
        return escaped(data)
    if isinstance(data, Mapping):
        return {key: _escaped_within(value) for key, value in data.items()}
    return [_escaped_within(item) for item in data] if isinstance(data, (list, tuple)) else data
