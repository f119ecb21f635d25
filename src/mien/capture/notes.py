"""Notes on many photos or frames, each said once."""

from __future__ import annotations

import re
from collections.abc import Iterable

_NAMED = 3
"""Names that are all told; of more only the first and their number."""
_OWN = "left out"
"""How notes begin that are about one picture alone: numbers in them are told, too."""


def gathered_notes(notes: Iterable[tuple[str, str]]) -> list[str]:
    """`NAME: NOTE` for each; where notes differ in numbers at most, `FIRST and 11 more: NOTE`,

    and up to three names in full.

    Args:
        notes: the picture's name and what is noted of it, in order.
    """
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, note in notes:
        key = note if note.startswith(_OWN) else re.sub(r"\d+(\.\d+)?", "#", note)
        alike.setdefault(key, []).append((name, note))
    return [_together(group) for group in alike.values()]


def _together(group: list[tuple[str, str]]) -> str:
    names = list(dict.fromkeys(name for name, _ in group))
    shown = ", ".join(names) if len(names) <= _NAMED else f"{names[0]} and {len(names) - 1} more"
    note = group[0][1]
    differ = any(other != note for _, other in group)
    return f"{shown}: {note}" + " (numbers of the first)" * differ
