"""docs/reference/timeline.md and fap.md say what the code does."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from mien.animate.channels import REGION_NAMES
from mien.animate.layers import GENERATORS
from mien.io.timeline.fap_table import PARAMETERS
from mien.io.timeline.timeline_file import check_timeline
from mien.io.timeline.timeline_json import DEGREES, load_timeline_json

REFERENCE = Path(__file__).parents[3] / "docs" / "reference"
PAGE = "".join((REFERENCE / name).read_text("utf-8") for name in ("timeline.md", "fap.md"))


def test_the_example_loads(tmp_path: Path) -> None:
    example = re.search(r"```json\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None
    (tmp_path / "a.json").write_text(example[1])
    timeline = load_timeline_json(tmp_path / "a.json")
    units = ("jawOpen", "browInnerUp", "mouthSmileLeft", "eyeBlinkLeft", "eyeBlinkRight")
    check_timeline(timeline, expressions=("joy", "anger"), units=units)
    state = timeline.at(3.4).state
    assert state.expressions["mouth"]["anger"] == pytest.approx(0.3)
    assert timeline.sample([0.8])["head.pitch"] > np.radians(4)


def test_all_regions_and_parameters_are_documented() -> None:
    for region in REGION_NAMES:
        assert f"`{region}`" in PAGE
    for parameter in PARAMETERS:
        assert f"| {parameter.number} {parameter.name} |" in PAGE


def test_generators_are_documented_with_their_defaults() -> None:
    for kind, made in GENERATORS.items():
        row = next(line for line in PAGE.splitlines() if line.startswith(f"| `{kind}`"))
        for item in fields(made):
            value = getattr(made(), item.name)
            shown = np.degrees(value) if item.name in DEGREES else value
            assert f"`{item.name}` {json.dumps(round(float(shown), 6)).removesuffix('.0')}" in row
