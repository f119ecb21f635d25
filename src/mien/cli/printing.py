"""Results and errors of commands, printed as text or JSON."""

from __future__ import annotations

import io
import json
import logging
import sys
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from mien.errors import FileFormatError, InputError, MienError, escaped

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout, no bars.")]


def print_error(error: Exception, *, as_json: bool) -> None:
    """One line on stderr, and as JSON an object on stdout."""
    line = _one_line(error)
    print("error:", line, file=sys.stderr)
    if as_json:
        data = {"error": {"message": line} | _parts(error)}
        print(json.dumps(_escaped_within(data), indent=2))


def _one_line(error: Exception) -> str:
    # Click's own complaints (an unknown option, a missing argument) format themselves.
    if hasattr(error, "format_message"):
        text = error.format_message()
    elif isinstance(error, (MienError, OSError)):
        text = str(error)
    else:
        # Click turns the end of a file into an abortion of its own.
        cause = error.__cause__ or error
        text = f"internal error: {type(cause).__name__}: {cause} (--debug shows where)"
    return " ".join(escaped(text).split())


def _parts(error: Exception) -> dict[str, str]:
    """Fields of an error, for programs."""
    if isinstance(error, InputError):
        return {"name": error.name, "expected": error.expected, "found": error.got}
    if isinstance(error, FileFormatError):
        return {"file": str(error.path), "place": error.place, "problem": error.problem}
    return {}


def print_result(
    as_json: bool, data: dict[str, Any], text: str, notes: tuple[str, ...] = ()
) -> None:
    """The result on stdout; notes on stderr, unless the JSON has them."""
    print(json.dumps(_escaped_within(data), indent=2) if as_json else escaped(text))
    for note in () if as_json else notes:
        print("note:", escaped(note), file=sys.stderr)


def set_up_streams() -> None:
    """Escapes characters that the terminal cannot show, instead of failing.

    Also silences Matplotlib, which MediaPipe imports, on its font cache.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _escaped_within(data: Any) -> Any:
    if isinstance(data, str):
        return escaped(data)
    if isinstance(data, Mapping):
        return {key: _escaped_within(value) for key, value in data.items()}
    return [_escaped_within(item) for item in data] if isinstance(data, (list, tuple)) else data
