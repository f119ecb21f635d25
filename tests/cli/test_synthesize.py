"""`mien synthesize` as in a terminal: pictures, shares, notes, and every kind of bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.feature_points import load_feature_layout
from mien.io.examples.example_folder import save_examples
from mien.io.files.image import load_image
from mien.io.landmarks.points_json import load_points_json
from mien.io.landmarks.pts import points_to_ibug, save_pts
from mien.io.landmarks.tem import points_to_tem, save_tem
from mien.pipelines.demo import demo_photos
from mien.synthesis.examples.example_set import ExampleSet
from terminal import Mien

LAYOUT = load_feature_layout()
SIZE = (300, 400)
Asked = Callable[..., Path]


@pytest.fixture(scope="session")
def folder(james_set: ExampleSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """His example folder. Read only."""
    place = tmp_path_factory.mktemp("examples") / "james"
    save_examples(place, james_set)
    return place


@pytest.fixture
def neutral(james_set: ExampleSet) -> Array:
    """Where all points are at rest."""
    return james_set.neutral.points.copy()


def test_the_neutral_points_give_the_neutral_photo(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    out, weights = tmp_path / "o.png", tmp_path / "W.json"
    data = mien(
        "synthesize", folder, "-o", out, "--points", asked(neutral), "--weights", weights, "--json"
    ).json
    assert (data["width"], data["height"], data["notes"]) == (*SIZE, [])
    assert (data["output"], data["weights"]) == (str(out), str(weights))
    assert max(data["hull_px"].values()) < 0.1
    photo = load_image(folder / "photos" / "e0.png").astype(float)
    assert np.abs(load_image(out) - photo).mean() < 0.5
    shares = json.loads(weights.read_text())["subregions"]
    assert all(next(iter(row)) == "e0" and row["e0"] > 0.9 for row in shares.values())


def test_three_points_are_enough(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    names = ("right_mouth_corner", "left_mouth_corner", "menton")
    neutral[LAYOUT.index("menton")] += [0, 3]
    ran = mien("synthesize", folder, "-o", tmp_path / "o.png", "--points", asked(neutral, *names))
    assert ran.status == 0
    assert ran.out == f"{tmp_path / 'o.png'}: {SIZE[0]}x{SIZE[1]}\n"


def test_all_points_are_saved_and_can_be_asked_for_again(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    names = ("right_mouth_corner", "left_mouth_corner", "menton")
    neutral[LAYOUT.index("menton")] += [0, 3]
    first, again, saved = tmp_path / "a.png", tmp_path / "b.png", tmp_path / "S.json"
    path = asked(neutral, *names)
    mien("synthesize", folder, "-o", first, "--points", path, "--save-points", saved)
    points = load_points_json(saved, LAYOUT)
    assert list(points) == list(LAYOUT.names)
    np.testing.assert_allclose(points["menton"], neutral[LAYOUT.index("menton")], atol=1e-3)
    mien("synthesize", folder, "-o", again, "--points", saved, "--head", "still")
    assert np.abs(load_image(first).astype(float) - load_image(again)).mean() < 0.2


def test_a_place_for_points_is_refused_before_the_work(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    path, out = asked(neutral), tmp_path / "o.png"
    ran = mien("synthesize", folder, "-o", out, "--points", path, "--save-points", "P.txt")
    assert ran.status == 2
    assert "P.txt: expected a name that ends in .json, .tem, .pts, got .txt" in ran.err
    assert not out.exists()


@pytest.mark.parametrize("suffix", [".tem", ".pts"])
def test_points_of_other_programs(
    mien: Mien, folder: Path, neutral: Array, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    if suffix == ".tem":
        save_tem(path, points_to_tem(LAYOUT, neutral))
    else:
        save_pts(path, points_to_ibug(LAYOUT, neutral))
    data = mien("synthesize", folder, "-o", tmp_path / "o.png", "--points", path, "--json").json
    assert data["notes"] == []
    photo = load_image(folder / "photos" / "e0.png").astype(float)
    assert np.abs(load_image(tmp_path / "o.png") - photo).mean() < 1


def test_a_head_that_moved_moves_the_picture(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    path, out = asked(neutral + np.array([20, -8])), tmp_path / "o.png"
    ran = mien("synthesize", folder, "-o", out, "--points", path)
    assert ran.status == 0
    assert ran.err.endswith(
        f"note: {path}: the head moved, and so does the picture (--head still: it did not)\n"
    )
    photo = load_image(folder / "photos" / "e0.png").astype(float)
    assert np.abs(load_image(out)[:-8, 20:] - photo[8:, :-20]).mean() < 1
    mien("synthesize", folder, "-o", out, "--points", path, "--head", "still")
    np.testing.assert_array_equal(load_image(out)[-20:, :20], photo[-20:, :20])


def test_subregions_outside_of_the_hull_are_noted(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    nose = [i for i, name in enumerate(LAYOUT.names) if name.startswith("nose")]
    neutral[nose] += [0, 15]
    ran = mien("synthesize", folder, "-o", tmp_path / "o.png", "--points", asked(neutral))
    assert ran.status == 0
    line = ran.err.splitlines()[-1]
    bound = "by more than 1% of the face's width"
    assert line.startswith(f"note: beyond what the examples show, {bound}: nose ")


def test_the_geometry_of_a_photo(
    mien: Mien, folder: Path, bare_james: Path, tmp_path: Path
) -> None:
    """The same face, larger, elsewhere: the picture gets the photo's size, the face its place."""
    out = tmp_path / "o.jpg"
    data = mien("synthesize", folder, "-o", out, "--photo", bare_james / "left.png", "--json").json
    photo = load_image(bare_james / "left.png")
    assert (data["height"], data["width"]) == photo.shape[:2]
    assert np.abs(load_image(out).astype(float) - photo).mean() < 8


def test_another_persons_photo_is_used_and_noted(mien: Mien, folder: Path, tmp_path: Path) -> None:
    long = Image.open(demo_photos() / "photo_left.png").convert("RGB").resize((400, 680))
    long.save(tmp_path / "long.png")
    ran = mien("synthesize", folder, "-o", tmp_path / "o.png", "--photo", tmp_path / "long.png")
    assert ran.status == 0
    assert f"note: {tmp_path / 'long.png'}: the face looks like another person's" in ran.err
    assert "its points are taken as they are" in ran.err


def test_a_face_that_the_photo_cuts_is_noted(
    mien: Mien, folder: Path, james_set: ExampleSet, tmp_path: Path
) -> None:
    """Through the mouth: the chin is a guess, the brows are not."""
    row = int(james_set.neutral.points[LAYOUT.index("upper_lip_outer"), 1])
    Image.fromarray(james_set.neutral.photo[:row]).save(tmp_path / "cut.png")
    ran = mien("synthesize", folder, "-o", tmp_path / "o.png", "--photo", tmp_path / "cut.png")
    assert "cut.png: the edge cuts the face, " in ran.err
    assert "points lie outside of the picture: they are a guess" in ran.err
    Image.fromarray(james_set.neutral.photo).save(tmp_path / "whole.png")
    ran = mien("synthesize", folder, "-o", tmp_path / "o.png", "--photo", tmp_path / "whole.png")
    assert "the edge cuts" not in ran.err


def test_annotated_points_beside_a_photo_replace_detected_ones(
    mien: Mien, folder: Path, james_set: ExampleSet, tmp_path: Path
) -> None:
    Image.fromarray(james_set.neutral.photo).save(tmp_path / "a.png")
    asked_of = ("synthesize", folder, "-o", tmp_path / "o.png", "--photo", tmp_path / "a.png")
    assert mien(*asked_of, "--json").json["hull_px"]["nose"] < 1
    tip = james_set.neutral.points[LAYOUT.index("nose_tip")] + [0, 12]
    marks = {"photo": "a.png", "size": list(SIZE), "points": {"nose_tip": tip.tolist()}}
    (tmp_path / "annotations").mkdir()
    (tmp_path / "annotations" / "a.json").write_text(json.dumps(marks))
    assert mien(*asked_of, "--json").json["hull_px"]["nose"] > 2


def test_the_papers_options_reach_the_synthesizer(
    mien: Mien,
    folder: Path,
    asked: Asked,
    neutral: Array,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from mien.pipelines import synthesize as module
    from mien.synthesis.inference.coefficients import UPPER_FACE
    from mien.synthesis.synthesizer import SynthesisOptions, Synthesizer

    used: list[SynthesisOptions] = []
    monkeypatch.setattr(
        module, "Synthesizer", lambda found, options: used.append(options) or Synthesizer(found)
    )
    ask = ("synthesize", folder, "-o", tmp_path / "o.png", "--points", asked(neutral))
    for options in (
        (),
        ("--paper",),
        ("--paper", "--distance-penalty", "0.1"),
        ("--slack", "0.01", "--upper-face-as-one"),
    ):
        assert mien(*ask, *options).status == 0
    assert used == [
        SynthesisOptions(),
        SynthesisOptions.paper(),
        replace(SynthesisOptions.paper(), distance_penalty=0.1),
        SynthesisOptions(slack=0.01, tied=(UPPER_FACE,)),
    ]


def flipped(points: Array) -> Array:
    """As if the picture had been mirrored."""
    return [SIZE[0], 0] + points * [-1, 1]


@pytest.mark.parametrize(
    ("points", "names", "message"),
    [
        (flipped, (), "expected right and left as the subject has them, got points that fit the"),
        (
            lambda points: points[LAYOUT.mirror],
            ("right_mouth_corner", "left_mouth_corner", "menton", "nose_tip"),
            "expected right and left as the subject has them",
        ),
        (
            lambda points: points * 4,
            (),
            "expected px of the neutral photo, which is 300x400, got ",
        ),
        (
            lambda points: points,
            ("menton", "nose_tip"),
            "expected at least 3 points of zhang134, got nose_tip, menton",
        ),
        (lambda points: points, ("menton",), "expected at least 3 points of zhang134, got menton"),
        (
            lambda points: 0 * points + 50,
            ("menton", "nose_tip", "right_mouth_corner"),
            "P.json: motion in the plane needs points apart from each other",
        ),
    ],
    ids=["flipped", "exchanged", "far outside", "two", "one", "one place"],
)
def test_points_of_another_space_are_refused(
    mien: Mien,
    folder: Path,
    asked: Asked,
    neutral: Array,
    tmp_path: Path,
    points: Callable[[Array], Array],
    names: tuple[str, ...],
    message: str,
) -> None:
    path = asked(points(neutral), *names)
    error = mien("synthesize", folder, "-o", tmp_path / "o.png", "--points", path, "--json").error
    assert message in error
    assert not (tmp_path / "o.png").exists()


def test_points_a_little_outside_are_noted(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    path = asked(neutral + np.array([0, SIZE[1] + 10 - neutral[:, 1].max()]))
    ran = mien("synthesize", folder, "-o", tmp_path / "o.png", "--points", path)
    assert ran.status == 0
    assert "points lie outside of the picture, " in ran.err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"layout": "zhang134", "points": {"menton": [NaN, 1]}}', "points.menton: expected a fin"),
        ('{"layout": "ibug68", "points": {"a": [1, 2]}}', "layout: expected 'zhang134', found 'i"),
        (
            '{"layout": "zhang134", "points": {"mentom": [1, 2]}}',
            "points.mentom: unknown point 'mentom'; did you mean menton?",
        ),
        ("[1, 2]", "expected an object, found a list"),
    ],
)
def test_files_of_points_that_are_broken(
    mien: Mien, folder: Path, tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "P.json"
    path.write_text(text)
    error = mien("synthesize", folder, "-o", tmp_path / "o.png", "--points", path, "--json").error
    assert error.startswith(f"{path}: {message}")


def test_neither_both_and_nothing_to_work_with(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path, wall: Array
) -> None:
    path, out = asked(neutral), tmp_path / "o.png"
    wanted = "expected --points FILE or --photo FILE: where the expression's points are"
    assert (
        mien("synthesize", folder, "-o", out, "--json").error
        == f"mien synthesize: {wanted}, got neither"
    )
    both = mien(
        "synthesize", folder, "-o", out, "--points", path, "--photo", "a.png", "--json"
    ).error
    assert both == f"mien synthesize: {wanted}, got both"
    Image.fromarray(wall).save(tmp_path / "wall.png")
    error = mien("synthesize", folder, "-o", out, "--photo", tmp_path / "wall.png", "--json").error
    assert error.startswith("wall.png: no face found")
    error = mien("synthesize", folder, "-o", out, "--photo", tmp_path / "none.png", "--json").error
    assert "none.png" in error
    error = mien("synthesize", tmp_path, "-o", out, "--points", path, "--json").error
    assert "is this an example folder?" in error
    error = mien("synthesize", tmp_path / "none", "-o", out, "--points", path, "--json").error
    assert "expected an example folder that `mien examples` made" in error
    error = mien("synthesize", folder, "-o", tmp_path / "o.gif", "--points", path, "--json").error
    assert "expected a name that ends in .png, .jpg, .jpeg" in error
    error = mien("synthesize", folder, "-o", out, "--points", path, "--slack", "-1", "--json").error
    assert error == "slack: expected a number of 0 or more, got -1.0"
    assert not out.exists()


def test_what_is_read_is_not_written_over(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    path, out, photo = asked(neutral), tmp_path / "o.png", tmp_path / "a.png"
    photo.write_bytes((folder / "photos" / "e0.png").read_bytes())
    before = (path.read_bytes(), photo.read_bytes())
    for options in (
        ("-o", out, "--points", path, "--weights", path),
        ("-o", out, "--points", path, "--weights", out),
        ("-o", out, "--points", path, "--save-points", path),
        ("-o", photo, "--photo", photo),
    ):
        error = mien("synthesize", folder, *options, "--json").error
        assert "expected a place of its own, got a file that is read or written as well" in error
    assert (path.read_bytes(), photo.read_bytes()) == before
    assert not out.exists()


def test_options_of_the_other_source_are_refused(
    mien: Mien, folder: Path, asked: Asked, neutral: Array, tmp_path: Path
) -> None:
    ask = ("synthesize", folder, "-o", tmp_path / "o.png", "--json")
    error = mien(*ask, "--points", asked(neutral), "--face", "1").error
    assert error == "--face: expected this only with --photo, got 1"
    error = mien(*ask, "--photo", folder / "photos" / "e0.png", "--head", "still").error
    assert error == "--head: expected this only with --points, got still"
