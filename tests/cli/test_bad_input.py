"""Whatever is wrong with a source becomes one clear line, or a note, that names the file."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from terminal import Built, Mien

FACES = pytest.mark.usefixtures("untextured")
SMALL = ("--texture-size", 64, "--json")


def save(path: Path, pixels: Array) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)


def remark(james: Path, side: str, **changed: Any) -> Path:
    """Change what an annotation file says."""
    path = james / "annotations" / f"{side}.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changed))
    return path


def pixels(path: Path) -> Array:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_no_such_folder(mien: Mien, tmp_path: Path) -> None:
    error = mien("build", tmp_path / "nowhere", "-o", tmp_path / "head", "--json").error
    assert error.startswith(f"{tmp_path / 'nowhere'}: expected ")
    assert not (tmp_path / "head").exists()


def test_a_folder_without_photos(mien: Mien, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    error = mien("build", tmp_path / "empty", "-o", tmp_path / "head", "--json").error
    assert error.startswith(f"{tmp_path / 'empty'}: expected ")


def test_a_photo_that_is_no_image(james: Path, mien: Mien, tmp_path: Path) -> None:
    (james / "left.png").write_text("not a picture")
    error = mien("build", james, "-o", tmp_path / "head", "--json").error
    assert error.startswith(
        f"{james / 'left.png'}: expected an image (JPEG, PNG, HEIC, ...), found"
    )


def test_a_truncated_jpeg(bare_james: Path, mien: Mien, tmp_path: Path) -> None:
    photo = bare_james / "left.jpg"
    Image.fromarray(pixels(bare_james / "left.png")).save(photo, quality=95)
    photo.write_bytes(photo.read_bytes()[:4000])
    error = mien("build", bare_james, "-o", tmp_path / "head", "--json").error
    assert error.startswith(f"{photo}: expected a whole image, found a damaged one")


def test_no_face(wall: Array, mien: Mien, tmp_path: Path) -> None:
    save(tmp_path / "walls" / "wall.png", wall)
    error = mien("build", tmp_path / "walls", "-o", tmp_path / "head", "--json").error
    assert error.startswith(f"{tmp_path / 'walls'}: no photo shows a face")
    assert "wall.png: left out: no face found" in error


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("build", "", "-o", "x"), "argument 1 of `mien build`"),
        (("examples", "", "-o", "x"), "argument 1 of `mien examples`"),
        (("track", "", "--head", "x", "-o", "x.csv"), "argument 1 of `mien track`"),
        (("render", "", "-o", "x.png"), "argument 1 of `mien render`"),
        (("build", "x", "-o", ""), "-o"),
        (("synthesize", "x", "--photo", "", "-o", "x.png"), "--photo"),
        (("track", "x", "--head=", "-o", "x.csv"), "--head"),
    ],
)
def test_nothing_given_is_not_the_current_folder(
    arguments: tuple[str, ...],
    name: str,
    mien: Mien,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert mien(*arguments).error.startswith(f"{name}: expected something")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["build", "examples"])
def test_what_mien_made_is_no_source(
    command: str, built: Built, mien: Mien, tmp_path: Path
) -> None:
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "examples.json").write_text('{"format": "mien examples"}')
    for source, kind in ((built.folder, "a head"), (tmp_path / "made", "an example")):
        error = mien(command, source, "-o", tmp_path / "out").error
        found = f"{kind} folder that mien made of them"
        assert error == f"{source}: expected photos or a video, got {found}"
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
@pytest.mark.parametrize("command", ["build", "examples"])
@pytest.mark.parametrize("within", [False, True])
def test_a_pipe_in_the_place_of_a_photo(
    command: str, within: bool, mien: Mien, tmp_path: Path
) -> None:
    (tmp_path / "photos").mkdir()
    os.mkfifo(tmp_path / "photos" / "a.jpg")
    source = tmp_path / "photos" if within else tmp_path / "photos" / "a.jpg"
    error = mien(command, source, "-o", tmp_path / "out").error
    assert error.startswith(f"{tmp_path / 'photos' / 'a.jpg'}: expected a photo")
    assert error.endswith("got a named pipe")


def test_postscript_in_the_place_of_a_photo(bare_james: Path, mien: Mien, tmp_path: Path) -> None:
    (bare_james / "left.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n{ } loop\n")
    error = mien("build", bare_james, "-o", tmp_path / "head").error
    expected = "expected an image (JPEG, PNG, HEIC, ...), found something else (PostScript)"
    assert error == f"{bare_james / 'left.png'}: {expected}"


@pytest.mark.parametrize("place", ["textures/atlas.png", "regions/left_mouth.png"])
@pytest.mark.parametrize("what", ["postscript", "pipe"])
def test_a_picture_of_a_head_that_is_none(
    place: str, what: str, built: Built, mien: Mien, tmp_path: Path
) -> None:
    head = shutil.copytree(built.folder, tmp_path / "head")
    (head / place).unlink()
    if what == "postscript":
        (head / place).write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n{ } loop\n")
    elif hasattr(os, "mkfifo"):
        os.mkfifo(head / place)
    else:
        pytest.skip("no named pipes on this system")
    found = "something else (PostScript)" if what == "postscript" else "a named pipe"
    error = mien("render", head, "-o", tmp_path / "x.png").error
    assert error.startswith(f"{head / place}: expected an image")
    assert error.endswith(f"found {found}")


@FACES
def test_photos_of_no_use_beside_good_ones(
    bare_james: Path, wall: Array, mien: Mien, tmp_path: Path
) -> None:
    save(bare_james / "wall.png", wall)
    shutil.copy(bare_james / "left.png", bare_james / "left_again.png")
    summary = mien("build", bare_james, "-o", tmp_path / "head", *SMALL).json
    assert "wall.png" in summary["left_out"]
    assert any(note.startswith("wall.png was left out: ") for note in summary["notes"])
    assert "left_again.png: left out: the same photo as left.png" in summary["notes"]
    photos = [item["photo"] for item in summary["expressions"]["neutral"]]
    assert photos == ["left.png", "right.png"]


@pytest.fixture
def couple(bare_james: Path) -> Path:
    """A photo of two faces: the right one in the picture is larger."""
    left, right = (pixels(bare_james / f"{side}.png") for side in ("left", "right"))
    canvas = np.zeros((500, 700, 3), np.uint8)
    canvas[:400, :300] = np.asarray(Image.fromarray(left).resize((300, 400)))
    canvas[:, 325:] = right
    shutil.rmtree(bare_james)
    save(bare_james / "couple.png", canvas)
    return bare_james


@FACES
def test_of_several_faces_the_largest_is_taken_unless_one_is_chosen(
    couple: Path, mien: Mien, tmp_path: Path
) -> None:
    notes, across = [], []
    for options in ((), ("--face", 1)):
        head = tmp_path / f"head{len(notes)}"
        notes.append(mien("build", couple, "-o", head, *options, *SMALL).json["notes"])
        data = json.loads((head / "head.json").read_text())
        (camera,) = data["expressions"]["neutral"]["cameras"]
        x, _, z = camera["t_cam_head_mm"]
        across.append(camera["principal_px"][0] + camera["focal_px"] * x / z)
    guess = "one photo: depth comes from the prior of faces, not from this person"
    choice = "couple.png: 2 faces: number 2 from the left, the largest, is used"
    assert notes == [[choice, guess], [guess]]
    assert across[1] < 325 < across[0]


def test_a_face_that_is_not_there(couple: Path, mien: Mien, tmp_path: Path) -> None:
    error = mien("build", couple, "-o", tmp_path / "head", "--face", 3, "--json").error
    assert error == "face: expected 1 to 2, the faces in couple.png, got 3"


def test_faces_count_from_one(james: Path, mien: Mien, tmp_path: Path) -> None:
    error = mien("build", james, "-o", tmp_path / "head", "--face", 0, "--json").error
    assert "--face" in error


@FACES
def test_all_photos_from_one_viewpoint(bare_james: Path, mien: Mien, tmp_path: Path) -> None:
    (bare_james / "right.png").unlink()
    left = pixels(bare_james / "left.png")
    save(bare_james / "again.png", np.roll(left, (9, -7), axis=(0, 1)))
    summary = mien("build", bare_james, "-o", tmp_path / "head", *SMALL).json
    assert any("look from nearly one side" in note for note in summary["notes"])
    assert list(summary["left_out"]) == ["again.png"]
    assert "one photo: depth comes from the prior" in summary["notes"][-1]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"points": {"chin": [float("nan"), 5]}}, "points.chin"),
        ({"points": {"chin": [1300, 5]}}, "points.chin"),
        ({"points": {"chim": [5, 5]}}, "points.chim: unknown name"),
        ({"curves": {"left_jaw": [[5, 5]]}}, "curves.left_jaw"),
        ({"size": [1000, 1600]}, "size: expected 375x500"),
    ],
)
def test_bad_annotations(
    change: dict[str, Any], problem: str, james: Path, mien: Mien, tmp_path: Path
) -> None:
    path = remark(james, "left", **change)
    error = mien("build", james, "-o", tmp_path / "head", "--json").error
    assert error.startswith(f"{path}: {problem}")


def test_annotations_that_are_no_json(james: Path, mien: Mien, tmp_path: Path) -> None:
    path = james / "annotations" / "left.json"
    path.write_text('{"points": ')
    error = mien("build", james, "-o", tmp_path / "head", "--json").error
    assert error.startswith(f"{path}: line 1, column 12: expected JSON")


def test_fewer_points_than_unknowns(wall: Array, mien: Mien, tmp_path: Path) -> None:
    source = tmp_path / "walls"
    save(source / "wall.png", wall)
    (source / "annotations").mkdir()
    marks = {"chin": [150, 300], "nose_tip": [150, 200], "nose_root": [150, 150]}
    (source / "annotations" / "wall.json").write_text(json.dumps({"points": marks}))
    error = mien("build", source, "-o", tmp_path / "head", "--json").error
    assert error == "wall.png: no photo fits: shows 3 points, needs 6"


@FACES
def test_marks_that_no_head_could_have_leave_the_photo_out(
    james: Path, mien: Mien, tmp_path: Path
) -> None:
    points = json.loads((james / "annotations" / "left.json").read_text())["points"]
    places = np.random.default_rng(1).permutation(list(points.values())).tolist()
    remark(james, "left", points=dict(zip(points, places, strict=True)), curves={})
    summary = mien("build", james, "-o", tmp_path / "head", *SMALL).json
    assert list(summary["left_out"]) == ["left.png"]
    assert [item["photo"] for item in summary["expressions"]["neutral"]] == ["right.png"]
    assert any(note.startswith("left.png was left out: its ") for note in summary["notes"])


def test_a_head_from_a_newer_version(built: Built, mien: Mien, tmp_path: Path) -> None:
    head = shutil.copytree(built.folder, tmp_path / "head")
    data = json.loads((head / "head.json").read_text())
    (head / "head.json").write_text(json.dumps(data | {"version": data["version"] + 1}))
    for command in (
        ["render", head, "-o", tmp_path / "x.png"],
        ["export", head, "-o", tmp_path / "x.glb"],
    ):
        error = mien(*command).error
        assert error.startswith(f"{head / 'head.json'}: version: ")
        assert "newer" in error


@pytest.mark.parametrize("what", ["nothing", "file", "folder"])
def test_what_is_no_head(what: str, mien: Mien, tmp_path: Path) -> None:
    head = tmp_path / "head"
    if what == "file":
        head.write_text("x")
    elif what == "folder":
        head.mkdir()
    error = mien("render", head, "-o", tmp_path / "x.png").error
    assert error.startswith(str(head))
    assert not (tmp_path / "x.png").exists()
