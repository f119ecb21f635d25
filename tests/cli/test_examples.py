"""`mien examples` as in a terminal: what it writes, what it says, what can be overruled."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from filmed import grey, written
from mien.arrays import Array
from mien.cli.examples import examples
from mien.io.examples.example_folder import load_examples, load_reasons
from mien.io.head.head_folder import load_head
from mien.pipelines.examples import ExampleRequest, gather_examples
from mien.render.picture import HeadRenderer
from mien.rig.state import FaceState
from terminal import Mien

OPEN = (0.0, 0.1, 0.3, 0.5, 0.7, 0.7)


@pytest.fixture(scope="module")
def frames(expressive: Path) -> list[Array]:
    """A head that opens its mouth, turns a little, and is gone."""
    renderer = HeadRenderer(load_head(expressive))
    drawn = [
        renderer.draw(
            FaceState(units={"jawOpen": amount}),
            renderer.camera(yaw=np.radians(number), size=(240, 288)),
            background=(90, 110, 130),
        )[..., :3]
        for number, amount in enumerate(OPEN)
    ]
    return [*drawn, np.full_like(drawn[0], 90)]


@pytest.fixture(scope="module")
def clip(frames: Sequence[Array], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("clip") / "anna.mp4", frames)


@pytest.fixture
def photos(frames: Sequence[Array], tmp_path: Path) -> Path:
    """Three photos and one without a face."""
    folder = tmp_path / "anna"
    folder.mkdir()
    for number in (0, 3, 4, 6):
        Image.fromarray(frames[number]).save(folder / f"photo_{number}.png")
    return folder


def choice_of(folder: Path) -> dict[str, str]:
    with (folder / "choice.csv").open(newline="") as file:
        return {row["picture"]: row["reason"] for row in csv.DictReader(file)}


def test_a_video(mien: Mien, clip: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    ran = mien("examples", clip, "-o", out)
    assert ran.status == 0
    examples = load_examples(out)
    # The last frame but one is blurred by nothing and like the one before.
    assert examples.neutral.name in {"frame_000000", "frame_000001"}
    standard = examples.examples[examples.standard]
    assert standard.name in {"frame_000004", "frame_000005"}
    assert examples.neutral.photo.shape == (288, 240, 3)
    assert len(examples.statistics) == 6
    assert examples.standard in examples.teeth
    assert 0 not in examples.teeth
    assert ran.out == (
        f"{out}: {len(examples.examples)} examples, point statistics of 6 pictures\n"
        f"  at rest: {examples.neutral.name}; mouth open: {standard.name}\n"
        f"  look at {out / 'examples.jpg'}\n"
    )
    chosen = len(examples.examples)
    assert f"note: of 7 pictures {chosen} chosen, " in ran.err
    assert "1 without a usable face" in ran.err
    choice = choice_of(out)
    assert len(choice) == 7
    assert choice["frame_000006.png"] == "no face found"
    assert choice[f"{standard.name}.png"] == "standard, its mouth is most open"
    assert load_reasons(out)[standard.name] == choice[f"{standard.name}.png"]
    with Image.open(out / "examples.jpg") as sheet:
        assert sheet.width > sheet.height


def test_photos_and_what_is_asked_for(mien: Mien, photos: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    options = ("--neutral", "photo_3.png", "--standard", "photo_0", "--exclude", "photo_4")
    data = mien("examples", photos, "-o", out, *options, "--json").json
    assert data["examples"] == str(out)
    assert data["neutral"] == "photo_3"
    assert data["standard"] == "photo_0"
    assert data["chosen"] == {"photo_3": "neutral", "photo_0": "standard, as asked for"}
    assert data["statistics"] == 2
    assert any("photo_6.png" in note for note in data["notes"]) is False
    assert choice_of(out)["photo_4.png"] == "excluded"
    assert choice_of(out)["photo_6.png"].startswith("no face found")


def test_fewer_and_smaller(mien: Mien, clip: Path, tmp_path: Path) -> None:
    options = ("--count", 2, "--max-side", 144, "--include", 2)
    data = mien("examples", clip, "-o", tmp_path / "set", *options, "--json").json
    # What is asked for counts, and the count is a limit to what is found only.
    assert data["chosen"]["frame_000002"] == "as asked for"
    assert len(data["chosen"]) == 3
    assert load_examples(tmp_path / "set").neutral.photo.shape == (144, 120, 3)


def test_annotated_points_replace_detected_ones(photos: Path) -> None:
    (photos / "annotations").mkdir()
    marks = {"layout": "zhang134", "points": {"nose_tip": [100.0, 150.0]}}
    (photos / "annotations" / "photo_0.json").write_text(json.dumps(marks))
    found = gather_examples(photos)
    nose = found.examples.layout.index("nose_tip")
    marked = next(e for e in found.examples.examples if e.name == "photo_0")
    np.testing.assert_array_equal(marked.points[nose], [100, 150])
    assert "photo_0.png: 1 points marked by hand" in found.notes


def test_one_photo_is_enough(mien: Mien, photos: Path, tmp_path: Path) -> None:
    for number in (3, 4, 6):
        (photos / f"photo_{number}.png").unlink()
    ran = mien("examples", photos, "-o", tmp_path / "set")
    assert ran.status == 0
    assert "1 examples, point statistics of 1 pictures" in ran.out
    assert "note: one example alone shows no expression but its own" in ran.err
    assert len(load_examples(tmp_path / "set").examples) == 1


def test_exposure_is_equalized_unless_switched_off(photos: Path, tmp_path: Path) -> None:
    with Image.open(photos / "photo_4.png") as image:
        darker = (np.asarray(image) * 0.8).astype(np.uint8)
    Image.fromarray(darker).save(photos / "photo_4.png")
    from mien.pipelines.examples import ExampleRequest

    asked = ExampleRequest(neutral="photo_0")
    even = gather_examples(photos, request=asked)
    assert "exposure of 1 examples brought to that of the face at rest" in even.notes
    plain = gather_examples(photos, request=ExampleRequest(neutral="photo_0", even=False))
    last = [e.name for e in even.examples.examples].index("photo_4")
    ratio = even.examples.examples[last].photo.mean() / plain.examples.examples[last].photo.mean()
    assert ratio == pytest.approx(1.25, abs=0.02)


def test_an_older_folder_is_replaced(mien: Mien, clip: Path, photos: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    assert mien("examples", clip, "-o", out, "--count", 2).status == 0
    assert mien("examples", photos, "-o", out).status == 0
    names = {path.stem for path in (out / "photos").iterdir()}
    assert names <= {"photo_0", "photo_3", "photo_4"}
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--neutral", "99"),
            "--neutral: expected the number of a frame, from 0 to 5, or its name",
        ),
        (("--exclude", "6"), "--exclude: expected a picture that shows the face, got frame_000006"),
        (("--neutral", "1", "--exclude", "1"), "exclude: expected others than those that are want"),
        (("--count", "0"), "Invalid value for '--count'"),
    ],
)
def test_requests_that_cannot_be_met(
    mien: Mien, clip: Path, tmp_path: Path, options: Sequence[str], message: str
) -> None:
    ran = mien("examples", clip, "-o", tmp_path / "set", "--json", *options)
    assert ran.status == 2
    assert ran.err.startswith(f"error: {message}")
    assert not (tmp_path / "set").exists()


def test_sources_and_places_that_cannot_be_used(
    mien: Mien, photos: Path, tmp_path: Path, contents: Callable[[Path], dict[str, bytes]]
) -> None:
    before = contents(photos)
    ran = mien("examples", photos, "-o", photos)
    assert (ran.status, "a folder with other things in it" in ran.err) == (2, True)
    assert contents(photos) == before
    ran = mien("examples", tmp_path / "nowhere", "-o", tmp_path / "set", "--json")
    assert ran.err.endswith("expected a photo, a video or a folder of photos, got nothing there\n")
    made = tmp_path / "made"
    assert mien("examples", photos, "-o", made).status == 0
    before = contents(made)
    ran = mien("examples", made, "-o", made)
    assert (ran.status, "expected photos or a video, got an example folder" in ran.err) == (2, True)
    assert contents(made) == before
    shutil.rmtree(photos)
    wall = written(tmp_path / "wall.mp4", grey([40, 90]))
    ran = mien("examples", wall, "-o", tmp_path / "set", "--json")
    assert (ran.status, ran.err) == (2, f"error: {wall}: no face found in any of its frames\n")
    assert not (tmp_path / "set").exists()


def test_the_command_and_the_library_have_the_same_defaults() -> None:
    """Options that are not given are those of a request."""
    usual = {name: option.default for name, option in signature(examples).parameters.items()}
    request = asdict(ExampleRequest())
    assert {name: usual[name] or request[name] for name in request} == request
    assert {name: usual[name] for name in ("count", "max_side", "even")}.items() <= request.items()
