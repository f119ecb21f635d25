"""The page of limits tells the numbers that hold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mien import limits

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "limits.md"
TOLD = dict(re.findall(r"^\| `([A-Z_]+)` \| ([^|]*) \|", PAGE.read_text("utf-8"), re.MULTILINE))
NAMES = [name for name in vars(limits) if name.isupper() and name != "MIB"]


def test_the_page_has_all_of_them() -> None:
    assert sorted(TOLD) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_number_is_told_as_it_is(name: str) -> None:
    told = [float(number) for number in re.findall(r"-?[\d.]+", TOLD[name].replace(",", ""))]
    value = getattr(limits, name)
    unit = limits.MIB if "MiB" in TOLD[name] else 1
    assert [number * unit for number in told] == list(
        value if isinstance(value, tuple) else [value]
    )
