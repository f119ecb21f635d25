"""The page of limits has the numbers that hold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mien import limits

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "limits.md"
DOCUMENTED = dict(
    re.findall(r"^\| `([A-Z_]+)` \| ([^|]*) \|", PAGE.read_text("utf-8"), re.MULTILINE)
)
NAMES = [name for name in vars(limits) if name.isupper() and name != "MIB"]


def test_the_page_has_all_of_them() -> None:
    assert sorted(DOCUMENTED) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_number_is_documented_as_it_is(name: str) -> None:
    documented = [
        float(number) for number in re.findall(r"-?[\d.]+", DOCUMENTED[name].replace(",", ""))
    ]
    value = getattr(limits, name)
    unit = limits.MIB if "MiB" in DOCUMENTED[name] else 1
    assert [number * unit for number in documented] == list(
        value if isinstance(value, tuple) else [value]
    )
