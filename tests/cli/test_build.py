"""`mien build` on real photos, small ones: what it leaves, and what it leaves alone."""

from __future__ import annotations

import errno
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mien.errors import InputError
from mien.io.head.head_folder import load_head, save_head
from mien.rig.regions import MASK_NAMES
from terminal import FAST, SHORT_TURNTABLE, Built, Mien

Contents = Callable[[Path], dict[str, bytes]]


def test_the_head_folder_is_what_the_design_says(built: Built) -> None:
    files = {str(path.relative_to(built.folder)) for path in built.folder.rglob("*.*")}
    assert files == {
        "head.json",
        "geometry.npz",
        "report.html",
        "turntable.mp4",
        "textures/atlas.png",
        "textures/cylinder.png",
        "photos/left.png",
        "photos/right.png",
        "annotations/left.json",
        "annotations/right.json",
        *(f"regions/{name}.png" for name in MASK_NAMES),
        ".mien-files.json",
    }


def test_head_json_has_every_photos_camera(built: Built) -> None:
    data = json.loads((built.folder / "head.json").read_text())
    assert data["subject"] == "james"
    views = data["expressions"]["neutral"]["cameras"]
    assert [view["photo"] for view in views] == ["left.png", "right.png"]
    for view in views:
        assert (view["width"], view["height"]) == (375, 500)
        rotation = np.array(view["R_cam_head"])
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert view["t_cam_head_mm"][2] > 300
        assert view["focal_px"] > 375
        assert view["points_used"] > 60
        assert 0 < view["rms_px"] < 5


def test_geometry_is_readable_without_mien(built: Built) -> None:
    with np.load(built.folder / "geometry.npz", allow_pickle=False) as arrays:
        vertices = arrays["vertices/neutral"]
        assert vertices.dtype == np.float32
        assert np.isfinite(vertices).all()
        assert arrays["triangles"].max() < len(vertices)
        assert arrays["uncertainty_mm"].shape == (len(vertices),)
    for name, size in (("atlas", (256, 256)), ("cylinder", (2048, 1024))):
        with Image.open(built.folder / "textures" / f"{name}.png") as texture:
            assert texture.size == size


def test_the_photos_are_kept_as_used(built: Built) -> None:
    given = built.source / "left.png"
    with Image.open(built.folder / "photos" / "left.png") as kept, Image.open(given) as image:
        np.testing.assert_array_equal(np.asarray(kept), np.asarray(image))


def test_the_marks_are_kept_in_the_pixels_of_the_photo_as_used(built: Built) -> None:
    given = json.loads((built.source / "annotations" / "left.json").read_text())
    kept = json.loads((built.folder / "annotations" / "left.json").read_text())
    assert kept["size"] == [375, 500]
    assert set(kept["points"]) == set(given["points"])
    factor = 375 / given["size"][0]
    for name, place in given["points"].items():
        np.testing.assert_allclose(kept["points"][name], np.array(place) * factor, atol=1e-3)


def test_what_json_says(built: Built) -> None:
    summary = built.summary
    assert summary["head"] == str(built.folder)
    assert Path(summary["report"]).is_file()
    photos = summary["expressions"]["neutral"]
    assert [photo["photo"] for photo in photos] == ["left.png", "right.png"]
    head = load_head(built.folder)
    for photo, view in zip(photos, head.views, strict=True):
        assert photo["focal_px"] == pytest.approx(view.camera.focal_px, abs=0.01)
        assert photo["points_used"] == view.points_used
        assert photo["distrusted"] == view.outliers
    assert summary["left_out"] == {}
    scaled, doubt = summary["notes"]
    assert scaled == "left.png, right.png: marks made at 1200x1600 are scaled to 375x500"
    # Two photos through a long lens.
    assert doubt.startswith("the angle between the photos is known to")


def test_the_same_photos_give_the_same_head(
    built: Built, mien: Mien, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mien.pipelines.build.turntable_frames", SHORT_TURNTABLE)
    source = shutil.copytree(built.source, tmp_path / "james")
    assert mien("build", source, "-o", tmp_path / "head", *FAST, "--json").json
    for file in sorted(path for path in built.folder.rglob("*.*") if path.is_file()):
        again = tmp_path / "head" / file.relative_to(built.folder)
        assert again.read_bytes() == file.read_bytes(), file


def test_the_papers_own_way_and_what_a_person_reads(
    james: Path, mien: Mien, tmp_path: Path, quick: None
) -> None:
    head = tmp_path / "head"
    options = ["--no-adjust", "--curves", "arc-length", "--fill", "grow", "--texture-size", 64]
    ran = mien("build", james, "-o", head, *options, "--interpupillary-mm", 60)
    assert ran.status == 0
    lines = ran.out.splitlines()
    assert lines[0] == f"{head}: a head from 2 photos"
    assert lines[1].startswith("  left.png: ")
    assert lines[-1] == f"  look at {head / 'report.html'}"
    for stage in ("Finding faces", "Solving cameras", "Extracting textures", "Writing the head"):
        assert stage in ran.err
    mesh = load_head(head).mesh
    eyes = [
        mesh.vertices[mesh.vertices_of(name)].mean(axis=0)
        for name in ("left_eyeball", "right_eyeball")
    ]
    assert np.linalg.norm(eyes[0] - eyes[1]) == pytest.approx(60, abs=1e-3)


def test_expression_folders_may_repeat_the_photos_names(
    james: Path, mien: Mien, tmp_path: Path, untextured: None
) -> None:
    source = tmp_path / "source"
    for expression, side in (("Neutral", "left"), ("joy", "right")):
        (source / expression / "annotations").mkdir(parents=True)
        shutil.copy(james / f"{side}.png", source / expression / "a.png")
        marks = source / expression / "annotations" / "a.json"
        shutil.copy(james / "annotations" / f"{side}.json", marks)
    head = tmp_path / "head"
    ran = mien("build", source, "-o", head, "--texture-size", 64)
    assert ran.out.splitlines()[1] == "  expressions: neutral, joy"
    made = load_head(head)
    photos = {name: item.views[0].photo for name, item in made.expressions.items()}
    assert photos == {"neutral": "neutral/a.png", "joy": "joy/a.png"}
    assert set(made.textures) == {"atlas", "cylinder", "joy"}
    for name, side in (("neutral", "left"), ("joy", "right")):
        kept = (head / "photos" / name / "a.png").read_bytes()
        with Image.open(io.BytesIO(kept)) as image, Image.open(james / f"{side}.png") as given:
            np.testing.assert_array_equal(np.asarray(image), np.asarray(given))
        assert (head / "annotations" / name / "a.json").is_file()


def test_without_a_neutral_folder(james: Path, mien: Mien, tmp_path: Path) -> None:
    source = tmp_path / "source"
    (source / "joy").mkdir(parents=True)
    shutil.copy(james / "left.png", source / "joy")
    error = mien("build", source, "-o", tmp_path / "head", "--json").error
    assert error == f"{source}: there is no folder called neutral among its folders"


def test_a_foreign_folder_is_refused_and_untouched(
    james: Path, mien: Mien, tmp_path: Path, contents: Contents
) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("years of work")
    before = contents(tmp_path)
    error = mien("build", james, "-o", mine).error
    refusal = "expected a new folder or one made by mien, got a folder with other things in it"
    assert error == f"{mine}: {refusal}"
    assert contents(tmp_path) == before


def test_a_file_in_the_way_is_refused_and_untouched(
    james: Path, mien: Mien, tmp_path: Path, contents: Contents
) -> None:
    (tmp_path / "head").write_text("mine")
    before = contents(tmp_path)
    error = mien("build", james, "-o", tmp_path / "head").error
    assert error == f"{tmp_path / 'head'}: expected a folder's name, got a file of that name"
    assert contents(tmp_path) == before


class Killed(BaseException):
    """Stands for a signal: no handler of errors may see it."""


def stop_at(monkeypatch: pytest.MonkeyPatch, place: str, error: BaseException) -> None:
    def stop(*arguments: object, **options: object) -> Any:
        raise error

    monkeypatch.setattr(place, stop)


@pytest.mark.parametrize("step", ["build_head", "write_head", "save_video", "render_report"])
def test_a_build_that_fails_leaves_the_old_head(
    step: str,
    built: Built,
    rebuilt: None,
    mien: Mien,
    tmp_path: Path,
    contents: Contents,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    head = shutil.copytree(built.folder, tmp_path / "place" / "head")
    before = contents(head.parent)
    stop_at(monkeypatch, f"mien.pipelines.build.{step}", InputError("left.png", "a face", "a wall"))
    ran = mien("build", built.source, "-o", head, "--json")
    assert ran.error == "left.png: expected a face, got a wall"
    assert contents(head.parent) == before


@pytest.mark.parametrize("step", ["build_head", "write_head", "save_video", "render_report"])
def test_a_build_that_is_killed_leaves_the_old_head(
    step: str,
    built: Built,
    rebuilt: None,
    mien: Mien,
    tmp_path: Path,
    contents: Contents,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    head = shutil.copytree(built.folder, tmp_path / "head")
    before = contents(head)
    stop_at(monkeypatch, f"mien.pipelines.build.{step}", Killed())
    with pytest.raises(Killed):
        mien("build", built.source, "-o", head, "--json")
    assert contents(head) == before


def test_an_old_head_is_replaced_whole(
    built: Built, rebuilt: None, mien: Mien, tmp_path: Path, contents: Contents
) -> None:
    head = tmp_path / "head"
    save_head(
        built.result.head, head, photos=[("of_the_last_build.png", np.zeros((8, 8, 3), "u1"))]
    )
    assert "photos/of_the_last_build.png" in contents(head)
    assert mien("build", built.source, "-o", head, "--json").json
    assert contents(head) == contents(built.folder)
    assert [path.name for path in tmp_path.iterdir()] == ["head"]


def test_a_place_that_cannot_be_written(
    built: Built, rebuilt: None, mien: Mien, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Simulated, as an administrator may write everywhere: making the folder is refused."""
    place, make = tmp_path / "locked" / "head", Path.mkdir

    def refuse(path: Path, *arguments: Any, **options: Any) -> None:
        if path.is_relative_to(tmp_path / "locked"):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        make(path, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", refuse)
    error = mien("build", built.source, "-o", place, "--json").error
    assert error == f"{place}: expected a place that can be written to, got Permission denied"


def test_a_full_disk(
    built: Built, rebuilt: None, mien: Mien, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    stop_at(monkeypatch, "mien.pipelines.build.write_head", full)
    error = mien("build", built.source, "-o", tmp_path / "head", "--json").error
    place = tmp_path / "head"
    assert error == f"{place}: expected a place that can be written to, got No space left on device"
    assert list(tmp_path.iterdir()) == []
