"""Folders that mien wrote, which are no source of photos although pictures lie in them."""

from __future__ import annotations

import re
from pathlib import Path

_INDEXES = {
    "head.json": (rb'"format"\s*:\s*"mien head"', "a head folder"),
    "examples.json": (rb'"format"\s*:\s*"mien examples"', "an example folder"),
}
_BEGINNING = 4096
"""Bytes within which both kinds of index say what they are."""


def made_by_mien(folder: Path) -> str:
    """What mien made this folder as, "a head folder" or "an example folder"; "" if it did not."""
    for name, (pattern, kind) in _INDEXES.items():
        index = folder / name
        try:
            # Never a pipe, which would be waited for.
            if index.is_file():
                with index.open("rb") as file:
                    if re.search(pattern, file.read(_BEGINNING)):
                        return kind
        except OSError:
            continue
    return ""
