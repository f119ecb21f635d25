"""The example folder: an exact round trip, and one clear line for whatever is wrong with it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.subregions import Subregions, default_subregions
from mien.errors import FileFormatError, InputError
from mien.io.examples.example_folder import (
    is_example_folder,
    load_examples,
    load_reasons,
    save_examples,
)
from mien.synthesis.examples.example_set import Example, ExampleSet

WHY = {"rest": "neutral", "joy": "standard"}


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


@pytest.fixture(scope="module")
def example_set(layout: FeatureLayout) -> ExampleSet:
    """Two photos of noise, of different sizes, points that no round decimal number tells."""
    rng = np.random.default_rng(4)
    places = [(60 + np.pi, 50.0, 61.0), (70 + np.e, 55.0, 66.0)]
    points = [scale * layout.template + (x, y) for scale, x, y in places]
    sizes = [(130, 110), (140, 150)]
    photos = [rng.integers(0, 256, (*size, 3), np.uint8) for size in sizes]
    examples = tuple(
        Example(name, photo, place, f"clip.mp4, frame {name}")
        for name, photo, place in zip(("rest", "joy"), photos, points, strict=True)
    )
    statistics = points[0] + rng.normal(size=(7, len(layout.names), 2))
    subregions = default_subregions(layout, points[1], (150, 140))
    return ExampleSet(layout, examples, 1, statistics, subregions, (1,))


@pytest.fixture
def folder(tmp_path: Path, example_set: ExampleSet) -> Path:
    save_examples(tmp_path / "set", example_set, why=WHY)
    return tmp_path / "set"


def opened(path: Path) -> Array:
    with Image.open(path) as image:
        return np.asarray(image)


def assert_same(found: ExampleSet, expected: ExampleSet) -> None:
    assert (found.standard, found.teeth) == (expected.standard, expected.teeth)
    for one, other in zip(found.examples, expected.examples, strict=True):
        assert (one.name, one.source) == (other.name, other.source)
        np.testing.assert_array_equal(one.photo, other.photo)
        np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(found.statistics, expected.statistics)
    assert found.subregions.names == expected.subregions.names
    np.testing.assert_array_equal(found.subregions.fades, expected.subregions.fades)
    for rows, others in zip(found.subregions.members, expected.subregions.members, strict=True):
        np.testing.assert_array_equal(rows, others)


def test_what_is_written_is_read_again_exactly(folder: Path, example_set: ExampleSet) -> None:
    assert_same(load_examples(folder), example_set)
    assert load_reasons(folder) == WHY
    assert not (folder / "subregions.npz").exists()


def test_subregions_of_ones_own_are_kept(tmp_path: Path, example_set: ExampleSet) -> None:
    fades = np.random.default_rng(1).random((140, 150, 2), np.float32) / 2
    own = Subregions(("upper", "lower"), fades, (np.arange(60), np.arange(50, 134)))
    changed = replace(example_set, subregions=own)
    save_examples(tmp_path / "set", changed)
    assert_same(load_examples(tmp_path / "set"), changed)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"names": np.array("upper")}, r"names: expected shape \(any\), found \(\)"),
        ({"names": np.array(["upper", "upper"])}, "subregions: expected names of their own"),
        ({"members/lower": np.array([1.5])}, "members/lower: expected whole numbers from 0 to 133"),
        ({"members/lower": np.arange(0)}, "members of lower: expected indices of points, one"),
        ({"fades": np.zeros((140, 150, 3))}, r"fades: expected shape \(140, 150, 2\), found"),
        ({"fades": np.full((140, 150, 2), np.nan)}, "fades: expected finite numbers"),
        (
            {"fades": np.full((140, 150, 2), 255)},
            r"fades: expected numbers from -2 to 2, found 255",
        ),
        ({"fades": np.full((140, 150, 2), -1.0)}, r"fades: expected shares .*, got -1 and a sum"),
    ],
)
def test_subregions_that_are_none(
    tmp_path: Path, example_set: ExampleSet, arrays: dict[str, Array], message: str
) -> None:
    fades = np.full((140, 150, 2), 0.5, np.float32)
    own = Subregions(("upper", "lower"), fades, (np.arange(60), np.arange(50, 134)))
    save_examples(tmp_path / "set", replace(example_set, subregions=own))
    file = tmp_path / "set" / "subregions.npz"
    np.savez(file, **(dict(np.load(file)) | arrays))
    with pytest.raises(FileFormatError, match=r"subregions\.npz: .*" + message):
        load_examples(tmp_path / "set")


def test_textures_lie_over_the_standard_image(folder: Path, example_set: ExampleSet) -> None:
    """The standard example's own is its photo; all have its size and are clear off the face."""
    own = opened(folder / "textures" / "joy.png")
    inside = own[..., 3] == 255
    assert 0.1 < inside.mean() < 0.9
    off = np.abs(own[inside][:, :3].astype(int) - example_set.examples[1].photo[inside])
    assert off.max() <= 1
    other = opened(folder / "textures" / "rest.png")
    np.testing.assert_array_equal(other[..., 3], own[..., 3])
    assert opened(folder / "standard.png").shape == (140, 150, 3)


def test_an_older_folder_is_replaced_as_a_whole(folder: Path, example_set: ExampleSet) -> None:
    subregions = default_subregions(example_set.layout, example_set.neutral.points, (110, 130))
    only = example_set.examples[:1]
    alone = replace(example_set, examples=only, standard=0, teeth=(), subregions=subregions)
    save_examples(folder, alone)
    assert sorted(path.name for path in (folder / "photos").iterdir()) == ["rest.png"]
    assert [path.name for path in folder.parent.iterdir()] == ["set"]


def test_other_things_are_not_replaced(tmp_path: Path, example_set: ExampleSet) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="a folder with other things in it"):
        save_examples(tmp_path, example_set)
    assert (tmp_path / "letter.txt").read_text() == "dear"


def test_a_set_that_cannot_be_written_leaves_the_old_one(
    folder: Path, example_set: ExampleSet
) -> None:
    bad = replace(example_set.examples[1], name="../joy")
    with pytest.raises(InputError, match=re.escape("a name that can be a file's, got '../joy'")):
        save_examples(folder, replace(example_set, examples=(example_set.neutral, bad)))
    assert_same(load_examples(folder), example_set)


def test_what_is_an_example_folder(folder: Path, tmp_path: Path) -> None:
    assert is_example_folder(folder)
    assert not is_example_folder(tmp_path)
    assert not is_example_folder(tmp_path / "nowhere")


Change = Callable[[dict[str, Any]], object]


def point(value: object) -> Change:
    return lambda data: data["examples"][1]["points"].update(chin=value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(version=9), "version: 9 was written by a newer mien"),
        (lambda d: d.update(format="mien head"), "format: expected 'mien examples', found 'mien h"),
        (lambda d: d.pop("standard"), "standard: missing"),
        (lambda d: d.update(standard="jo"), "standard: unknown example 'jo'; did you mean joy?"),
        (lambda d: d.update(teeth=["x"]), r"teeth\[0\]: unknown example 'x'"),
        (lambda d: d.update(neutral="joy"), "neutral: expected 'rest', the first example; found"),
        (lambda d: d.update(examples=[]), "examples: expected at least one, the neutral face"),
        (lambda d: d["examples"].append(d["examples"][0]), "names of their own, got 'rest' twice"),
        (lambda d: d["layout"].update(name="ibug"), "layout: expected the .* of zhang134, found"),
        (lambda d: d["layout"]["points"].reverse(), "layout: .* found .* of zhang134, other ones"),
        (
            point([float("nan"), 1.0]),
            r"examples\[1\].points.chin: expected a finite number, f.* nan",
        ),
        (point([1.0]), r"examples\[1\].points.chin: expected \[x, y\] in px, found 1 numbers"),
        (point("left"), r"examples\[1\].points.chin: expected a list, found text 'left'"),
        (
            lambda d: d["examples"][1]["points"].pop("chin"),
            r"examples\[1\].points.chin: missing",
        ),
        (
            lambda d: d["examples"][0].update(photo="../rest.png"),
            r"examples\[0\].photo: expected a file within the folder, found '../rest.png'",
        ),
    ],
)
def test_a_broken_index(folder: Path, change: Change, message: str) -> None:
    path = folder / "examples.json"
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(FileFormatError, match=message) as caught:
        load_examples(folder)
    assert str(caught.value).startswith(str(path))


def test_an_index_that_is_no_json(folder: Path) -> None:
    (folder / "examples.json").write_text('{"format": ')
    with pytest.raises(FileFormatError, match=r"examples.json: line 1, column 12: expected JSON"):
        load_examples(folder)


def test_folders_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match="an example folder that `mien examples` made, got nothing"
    ):
        load_examples(tmp_path / "nowhere")
    with pytest.raises(FileFormatError, match=r"examples\.json: there is no such file; is this an"):
        load_examples(tmp_path)


def test_a_missing_photo(folder: Path) -> None:
    (folder / "photos" / "joy.png").unlink()
    with pytest.raises(FileFormatError, match=r"joy.png: there is no such file"):
        load_examples(folder)


def test_a_photo_of_another_size(folder: Path) -> None:
    Image.new("RGB", (30, 20)).save(folder / "photos" / "joy.png")
    with pytest.raises(
        FileFormatError, match=r"joy.png: expected \[150, 140\] px, found \[30, 20\]"
    ):
        load_examples(folder)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"others": np.zeros(3)}, "geometries: missing"),
        (
            {"geometries": np.zeros((4, 68, 2))},
            r"expected shape \(any, 134, 2\), found \(4, 68, 2\)",
        ),
        ({"geometries": np.full((4, 134, 2), np.nan)}, "geometries: expected finite numbers"),
        ({"geometries": np.zeros((4, 134, 2))}, r"geometries\[0\]: expected points of a face, f"),
        ({"geometries": np.zeros((0, 134, 2))}, "geometries: expected at least one"),
    ],
)
def test_statistics_of_something_else(folder: Path, arrays: dict[str, Array], message: str) -> None:
    np.savez(folder / "statistics.npz", **arrays)
    with pytest.raises(FileFormatError, match=r"statistics.npz: .*" + message):
        load_examples(folder)


def test_statistics_that_are_no_archive(folder: Path) -> None:
    (folder / "statistics.npz").write_bytes(b"statistics")
    with pytest.raises(FileFormatError, match=r"statistics.npz: not a readable .npz file"):
        load_examples(folder)
    (folder / "statistics.npz").unlink()
    with pytest.raises(FileFormatError, match=r"statistics.npz: there is no such file"):
        load_examples(folder)


def test_the_documented_way_to_read_it(
    folder: Path, example_set: ExampleSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """docs/reference/example-folder.md shows how to read the folder with numpy; it must be true."""
    text = (Path(__file__).parents[3] / "docs" / "reference" / "example-folder.md").read_text(
        "utf-8"
    )
    code = text.split("```python\n")[1].split("```")[0]
    folder.rename(folder.with_name("anna"))
    monkeypatch.chdir(folder.parent)
    found: dict[str, Any] = {}
    exec(code, found)
    np.testing.assert_array_equal(found["points"][1], example_set.examples[1].points)
    expected = example_set.statistics - example_set.neutral.points
    np.testing.assert_array_equal(found["displacements"], expected)


def test_the_documented_keys_are_those_written(folder: Path) -> None:
    text = (Path(__file__).parents[3] / "docs" / "reference" / "example-folder.md").read_text(
        "utf-8"
    )
    shown = json.loads(text.split("```json\n")[1].split("```")[0])
    written = json.loads((folder / "examples.json").read_text())
    assert list(shown) == list(written)
    assert list(shown["examples"][0]) == list(written["examples"][0])
    assert list(shown["layout"]) == list(written["layout"])


def test_places_are_in_one_line(folder: Path) -> None:
    text = (folder / "examples.json").read_text()
    assert re.search(r'"chin": \[[\d.]+, [\d.]+\]', text)
