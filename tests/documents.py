"""JSON documents, changed in one place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def put(*keys: str | int, to: Any) -> Callable[[Any], None]:
    """What sets document[key][key]... to something else."""

    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = to

    return change
