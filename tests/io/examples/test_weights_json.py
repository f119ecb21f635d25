"""W.json says of each subregion what it was made from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.errors import InputError
from mien.io.examples.weights_json import save_weights
from mien.synthesis.examples.example_set import Example, ExampleSet


@pytest.fixture(scope="module")
def example_set() -> ExampleSet:
    layout = load_feature_layout()
    points = (layout.template - layout.template.mean(0)) * 60 + 50
    photo = np.zeros((100, 100, 3), np.uint8)
    names = ("neutral", "joy", "anger")
    examples = tuple(Example(name, photo, points, f"{name}.jpg") for name in names)
    subregions = default_subregions(layout, points, (100, 100))
    return ExampleSet(layout, examples, 0, np.stack([points] * 2), subregions)


def test_coefficients_are_by_name_largest_first(tmp_path: Path, example_set: ExampleSet) -> None:
    names = example_set.subregions.names
    shares = np.tile([0.25, 0.75, 0.0], (len(names), 1))
    shares[1] = [1 - 1e-5, 0, 1e-5]
    hull = np.arange(len(names)) / 7
    save_weights(tmp_path / "W.json", example_set, shares, hull)
    data = json.loads((tmp_path / "W.json").read_text())
    assert (data["format"], data["version"]) == ("mien weights", 1)
    assert data["examples"][1] == {"name": "joy", "source": "joy.jpg"}
    assert list(data["subregions"]) == list(data["hull_px"]) == list(names)
    assert list(data["subregions"][names[0]].items()) == [("joy", 0.75), ("neutral", 0.25)]
    assert data["subregions"][names[1]] == {"neutral": 0.99999}
    assert data["hull_px"][names[1]] == 0.143


def test_shares_of_other_examples_are_refused(tmp_path: Path, example_set: ExampleSet) -> None:
    count = len(example_set.subregions.names)
    with pytest.raises(InputError, match="coefficients: expected shape"):
        save_weights(tmp_path / "W.json", example_set, np.ones((count, 2)), np.zeros(count))
    assert not (tmp_path / "W.json").exists()
