"""Subregions that a user drew: from the file to the picture, as the documentation shows it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.subregions import default_subregions
from mien.io.examples.example_folder import load_examples, save_examples
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.synthesizer import Synthesizer

PAGE = Path(__file__).parents[3] / "docs" / "guide" / "subregions.md"
SIZE = (160, 200)


@pytest.fixture
def examples() -> ExampleSet:
    """A grey face at rest, a white one with raised brows and a black one with an open mouth."""
    layout = load_feature_layout()
    rest = 110 * layout.template + (80, 66)
    places = [
        rest,
        rest + _where(layout, "brow", (0, -8)),
        rest + _where(layout, "lower_lip", (0, 6)),
    ]
    shown = tuple(
        Example(name, np.full((*SIZE[::-1], 3), grey, np.uint8), points, name)
        for name, grey, points in zip(("rest", "up", "open"), (80, 250, 10), places, strict=True)
    )
    return ExampleSet(layout, shown, 0, np.stack(places), default_subregions(layout, rest, SIZE))


def _where(layout: FeatureLayout, word: str, motion: tuple[float, float]) -> Array:
    return np.outer([word in name for name in layout.names], motion)


def test_the_drawing_of_the_documentation_draws_and_mixes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, examples: ExampleSet
) -> None:
    monkeypatch.chdir(tmp_path)
    save_examples("anna-examples", examples)
    (script,) = (
        block
        for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
        if "mine.json" in block
    )
    exec(script, {})
    mine = load_examples("anna-softer")
    names = mine.subregions.names
    assert set(examples.subregions.names) - set(names) == {"right_brow", "left_brow"}

    layout, rest = mine.layout, mine.neutral.points
    brow, lip = layout.index("right_brow_upper.2"), layout.index("lower_lip_outer")
    column, row = np.floor(rest[brow]).astype(int)
    assert mine.subregions.fades[row, column, names.index("forehead")] > 0.5

    up, opened = (example.points - rest for example in mine.examples[1:])
    found = Synthesizer(mine).synthesize(rest + up + opened)
    assert found.coefficients.shape == (len(names), 3)
    assert found.coefficients[names.index("forehead"), 1] > 0.9
    assert found.coefficients[names.index("chin"), 2] > 0.9
    at_brow, at_lip = (
        found.image[tuple(np.floor(found.points[index]).astype(int)[::-1])].mean()
        for index in (brow, lip)
    )
    assert at_brow > 200
    assert at_lip < 40
