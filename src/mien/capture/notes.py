"""Notes on many photos or frames, equal ones merged."""

from __future__ import annotations

import re
from collections.abc import Iterable

_MAX_LISTED = 3
"""So many names are listed; of more only the first and their number."""
_OWN = "left out"
"""How notes begin that are about one picture alone: their numbers must agree, too, to be merged."""


def merge_notes(notes: Iterable[tuple[str, str]]) -> list[str]:
    """`NAME: NOTE` for each; of notes that differ in numbers at most, `FIRST and 11 more: NOTE`.

    Up to three names are listed in full.

    Args:
        notes: names of pictures and notes on them, in order.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, note in notes:
        key = note if note.startswith(_OWN) else re.sub(r"\d+(\.\d+)?", "#", note)
        groups.setdefault(key, []).append((name, note))
    return [_merged(group) for group in groups.values()]


def _merged(group: list[tuple[str, str]]) -> str:
    names = list(dict.fromkeys(name for name, _ in group))
    shown = (
        ", ".join(names) if len(names) <= _MAX_LISTED else f"{names[0]} and {len(names) - 1} more"
    )
    note = group[0][1]
    differ = any(other != note for _, other in group)
    return f"{shown}: {note}" + " (numbers of the first)" * differ
