"""What commands print in the end, as text or as JSON."""

from __future__ import annotations

import json
import sys
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout, no bars.")]


def print_result(
    as_json: bool, data: dict[str, Any], text: str, notes: tuple[str, ...] = ()
) -> None:
    """The result on stdout; notes, which the JSON has in it, on stderr."""
    print(json.dumps(data, indent=2) if as_json else text)
    for note in () if as_json else notes:
        print("note:", note, file=sys.stderr)
