"""No command writes over what it reads, or loses what somebody has put beside its results."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from PIL import Image

from mien.io.examples.example_folder import save_examples
from mien.pipelines.demo import demo_photos
from mien.synthesis.examples.example_set import ExampleSet
from terminal import FAST, Mien

SMALL = ("--size", "48x60")


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.fixture
def head(expressive: Path, tmp_path: Path) -> Path:
    """A head that may be spoilt."""
    return Path(shutil.copytree(expressive, tmp_path / "anna"))


@pytest.fixture
def take(tmp_path: Path) -> Path:
    path = tmp_path / "take.json"
    document = {"format": "mien timeline", "version": 1, "fps": 10, "duration": 0.2}
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("name", ["textures/atlas.png", "regions/left_eye.png", "textures/joy.png"])
def test_render_refuses_a_file_of_the_head(name: str, head: Path, mien: Mien) -> None:
    before = contents(head)
    error = mien("render", head, "-o", head / name, *SMALL).error
    assert error == (
        f"{head / name}: expected a place of its own, got a file of {head}, which is read"
    )
    assert contents(head) == before


def test_a_picture_in_the_heads_folder_is_no_part_of_it(head: Path, mien: Mien) -> None:
    for _ in range(2):
        assert mien("render", head, "-o", head / "preview.png", *SMALL).status == 0


@pytest.mark.parametrize("name", ["atlas.obj", "atlas.png"])
def test_export_refuses_a_file_of_the_head(name: str, head: Path, mien: Mien) -> None:
    """The .obj brings a .png of the same name along."""
    before = contents(head)
    out = (head / "textures" / name).with_suffix(".obj")
    assert (
        "atlas.png: expected a place of its own, got a file of"
        in mien("export", head, "-o", out).error
    )
    assert contents(head) == before


def test_export_leaves_a_picture_of_the_same_name(head: Path, mien: Mien, tmp_path: Path) -> None:
    (tmp_path / "face.png").write_text("mine")
    error = mien("export", head, "-o", tmp_path / "face.obj").error
    assert error.startswith(f"{tmp_path / 'face.png'}: expected a free place for what goes beside")
    assert (tmp_path / "face.png").read_text() == "mine"
    assert not (tmp_path / "face.obj").exists()


@pytest.mark.parametrize("suffix", [".csv", ".fap", ".mp4"])
def test_animate_refuses_its_timeline(
    suffix: str, head: Path, take: Path, mien: Mien, tmp_path: Path
) -> None:
    """Under whatever name: a link to it is the timeline, too."""
    out = tmp_path / f"take{suffix}"
    out.symlink_to(take)
    before = take.read_bytes()
    error = mien("animate", take, "--head", head, "-o", out).error
    assert (
        error == f"{out}: expected a place of its own, got a file that is read or written as well"
    )
    assert take.read_bytes() == before


def test_animate_refuses_the_head_and_what_holds_its_timeline(
    head: Path, take: Path, mien: Mien, tmp_path: Path
) -> None:
    frames = tmp_path / "frames"
    assert mien("animate", take, "--head", head, "-o", f"{frames}/", *SMALL).status == 0
    inside = Path(shutil.copy(take, frames))
    before = contents(tmp_path)
    error = mien("animate", inside, "--head", head, "-o", f"{frames}/", *SMALL).error
    assert "got a folder with other things in it" in error
    assert (
        "got a folder with other things" in mien("animate", take, "--head", head, "-o", head).error
    )
    assert contents(tmp_path) == before


def test_track_refuses_its_own_sidecar_and_journal(head: Path, mien: Mien, tmp_path: Path) -> None:
    clip = tmp_path / "clip.mp4"
    clip.write_bytes(b"any")
    for option, name in {"--live-link": "t.json", "--openface": "t.csv.part"}.items():
        error = mien(
            "track", clip, "--head", head, "-o", tmp_path / "t.csv", option, tmp_path / name
        )
        assert error.error.startswith(f"{tmp_path / name}: expected a place of its own")
    for name in ("head.json", "geometry.npz"):
        error = mien(
            "track", clip, "--head", head, "-o", tmp_path / "t.csv", "--openface", head / name
        )
        assert error.error.startswith(f"{head / name}: expected a place of its own, got a file of")


def test_synthesize_refuses_an_example_and_marks(
    james_set: ExampleSet, mien: Mien, tmp_path: Path
) -> None:
    folder = tmp_path / "ex"
    save_examples(folder, james_set)
    photo = Path(shutil.copy(demo_photos() / "photo_left.png", tmp_path / "p.png"))
    marks = tmp_path / "p.tem"
    marks.write_text("mine")
    before = contents(tmp_path)
    for options, name in (
        (
            ("-o", folder / "photos" / "e0.png"),
            "e0.png: expected a place of its own, got a fi",
        ),
        (("-o", tmp_path / "o.png", "--weights", folder / "examples.json"), "examples.json: exp"),
        (("-o", tmp_path / "o.png", "--save-points", marks), "p.tem: expected a place of its own"),
    ):
        assert name in mien("synthesize", folder, "--photo", photo, *options).error
    assert contents(tmp_path) == before


@pytest.mark.parametrize("where", ["mine", "photos", "."])
def test_a_source_inside_the_folder_that_is_replaced(
    where: str, head: Path, james_set: ExampleSet, mien: Mien, tmp_path: Path
) -> None:
    save_examples(tmp_path / "ex", james_set)
    for command, folder in (("build", head), ("examples", tmp_path / "ex")):
        source = folder / where
        source.mkdir(exist_ok=True)
        shutil.copy(demo_photos() / "photo_left.png", source / "extra.png")
        before = contents(folder)
        error = mien(command, source, "-o", folder).error
        assert where == "." or error == (
            f"{folder}: expected a folder that nothing is read from, got one with {source}"
        )
        assert contents(folder) == before


@pytest.mark.usefixtures("rebuilt")
def test_a_rebuilt_head_keeps_notes_takes_and_masks(
    james: Path, take: Path, mien: Mien, tmp_path: Path
) -> None:
    head = tmp_path / "anna"
    build = ("build", james, "-o", head, *FAST, "--json")
    notes = mien(*build).json["notes"]
    (head / "notes.txt").write_text("mine")
    assert mien("animate", take, "--head", head, "-o", head / "take.mp4", *SMALL).status == 0
    mask = head / "regions" / "left_eye.png"
    Image.new("L", (16, 16), 255).save(mask)
    (head / "textures" / "atlas.png").write_bytes(b"painted over")
    painted, film, before = mask.read_bytes(), (head / "take.mp4").read_bytes(), set(contents(head))
    again = mien(*build).json["notes"]
    assert mask.read_bytes() == painted
    assert (head / "notes.txt").read_text() == "mine"
    assert (head / "take.mp4").read_bytes() == film
    assert (head / "kept" / "textures" / "atlas.png").read_bytes() == b"painted over"
    assert set(contents(head)) == before | {"kept/textures/atlas.png"}
    names = "notes.txt, take.mp4, kept/textures/atlas.png, regions/left_eye.png"
    assert again == [*notes, f"{head}: kept, as mien did not write it: {names}"]
