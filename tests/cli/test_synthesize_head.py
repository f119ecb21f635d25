"""`mien synthesize` of a head folder: pictures, shares, notes, and every kind of bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.feature_points import load_feature_layout
from mien.io.files.image import load_image
from mien.io.head.head_folder import load_head
from mien.io.landmarks.points_json import save_points_json
from mien.synthesis.heads.feature_points import feature_points_on
from terminal import Mien

LAYOUT = load_feature_layout()
VIEW = ("--yaw", "20", "--size", "200x250", "--background", "#484a54")
Asked = Callable[..., Path]


@pytest.fixture
def points(expressive: Path) -> dict[str, Array]:
    """All points of each expression."""
    shapes = load_head(expressive).expressions
    return {name: feature_points_on(item.vertices) for name, item in shapes.items()}


def test_an_expressions_points_give_its_picture(
    mien: Mien, expressive: Path, points: dict[str, Array], asked: Asked, tmp_path: Path
) -> None:
    out, weights, other = tmp_path / "o.png", tmp_path / "W.json", tmp_path / "r.png"
    path = asked(points["joy"])
    asking = ("synthesize", expressive, "-o", out, "--points", path, "--weights", weights)
    data = mien(*asking, *VIEW, "--json").json
    assert (data["width"], data["height"], data["notes"]) == (200, 250, [])
    assert max(data["hull_mm"].values()) < 0.01
    shares = json.loads(weights.read_text())
    assert all(row["joy"] > 0.99 for row in shares["subregions"].values())
    assert {entry["name"] for entry in shares["examples"]} == set(points)
    assert list(shares["hull_mm"]) == list(shares["subregions"])
    assert mien("render", expressive, "-o", other, "--expression", "joy=1", *VIEW).status == 0
    off = np.abs(load_image(out).astype(float) - load_image(other))
    assert off.mean() < 0.1


def test_one_point_is_enough(
    mien: Mien, expressive: Path, points: dict[str, Array], asked: Asked, tmp_path: Path
) -> None:
    out, still = tmp_path / "o.png", tmp_path / "r.png"
    path = asked(points["neutral"] + [0, -8, 0], "menton")
    ran = mien("synthesize", expressive, "-o", out, "--points", path, *VIEW)
    assert (ran.status, ran.out) == (0, f"{out}: 200x250\n")
    mien("render", expressive, "-o", still, *VIEW)
    off = np.abs(load_image(out).astype(float) - load_image(still)).max(axis=2)
    assert off[150:].mean() > 5 * off[:100].mean()


def test_subregions_outside_of_the_hull_are_noted(
    mien: Mien, expressive: Path, points: dict[str, Array], asked: Asked, tmp_path: Path
) -> None:
    moved = points["neutral"].copy()
    moved[[i for i, name in enumerate(LAYOUT.names) if name.startswith("nose")]] += [0, 0, 9]
    path = asked(moved)
    for way in ((), ("--paper",)):
        ran = mien("synthesize", expressive, "-o", tmp_path / "o.png", "--points", path, *way)
        assert ran.status == 0
        assert ran.err.splitlines()[-1].startswith(
            "note: beyond what the expressions show: nose by"
        )


def test_the_face_of_a_photo(
    mien: Mien, expressive: Path, bare_james: Path, tmp_path: Path
) -> None:
    """A photo that the head is made of: drawn over it, where its face is."""
    out = tmp_path / "o.png"
    photo = bare_james / "left.png"
    data = mien("synthesize", expressive, "-o", out, "--photo", photo, "--json").json
    pixels = load_image(photo)
    assert (data["height"], data["width"]) == pixels.shape[:2]
    assert data["notes"] == []
    off = np.abs(load_image(out).astype(float) - pixels)
    assert 0.1 < off.mean() < 8


def test_a_face_that_does_not_look_like_the_head_is_noted(
    mien: Mien, expressive: Path, bare_james: Path, tmp_path: Path
) -> None:
    """James from above, light and dark exchanged."""
    pixels = 255 - load_image(bare_james / "left.png") // 2
    Image.fromarray(pixels).save(tmp_path / "other.png")
    ran = mien(
        "synthesize", expressive, "-o", tmp_path / "o.png", "--photo", tmp_path / "other.png"
    )
    assert ran.status == 0
    assert "note: other.png: the face does not look like the head's" in ran.err


def test_a_photo_without_a_face(mien: Mien, expressive: Path, wall: Array, tmp_path: Path) -> None:
    Image.fromarray(wall).save(tmp_path / "wall.png")
    asking = ("synthesize", expressive, "-o", tmp_path / "o.png", "--json")
    assert mien(*asking, "--photo", tmp_path / "wall.png").error.startswith("wall.png: no face")
    assert "none.png" in mien(*asking, "--photo", tmp_path / "none.png").error
    assert not (tmp_path / "o.png").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda points: points * [-1, 1, 1], "expected right and left as the subject has them"),
        (
            lambda points: points + np.array([0, 200, 0]),
            "expected mm in the head's own space, near the face",
        ),
    ],
)
def test_points_of_another_space_are_refused(
    mien: Mien,
    expressive: Path,
    points: dict[str, Array],
    asked: Asked,
    tmp_path: Path,
    change: Callable[[Array], Array],
    message: str,
) -> None:
    path, out = asked(change(points["neutral"])), tmp_path / "o.png"
    error = mien("synthesize", expressive, "-o", out, "--points", path, "--json").error
    assert error.startswith(f"{path}: {message}")
    assert not out.exists()


def test_points_of_a_picture_are_refused(mien: Mien, expressive: Path, tmp_path: Path) -> None:
    save_points_json(tmp_path / "P.json", LAYOUT, {"menton": np.array([4.0, 5.0])})
    (tmp_path / "a.pts").write_text("")
    asking = ("synthesize", expressive, "-o", tmp_path / "o.png", "--json", "--points")
    error = mien(*asking, tmp_path / "P.json").error
    assert error.endswith("points.menton: expected x, y and z, found 2 numbers")
    assert (
        "expected a .json of points in space, got .pts" in mien(*asking, tmp_path / "a.pts").error
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "mien synthesize: expected --points FILE or --photo FILE"),
        (("--points", "a.json", "--photo", "a.png"), "got both"),
        (("--points", "a.json", "--head", "moved"), "--head: expected this only with a set of ex"),
        (
            ("--points", "a.json", "--face", "2"),
            "--face: expected this only with a set of examples",
        ),
        (("--photo", "a.png", "--yaw", "9"), "--yaw: expected this only with --points"),
        (("--points", "a.json", "--size", "9"), "--size: expected WIDTHxHEIGHT"),
        (("--points", "a.json", "--yaw", "nan"), "--yaw: expected a finite number"),
        (("--points", "a.json"), "a.json"),
    ],
)
def test_options_that_do_not_go_together(
    mien: Mien, expressive: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    error = mien("synthesize", expressive, "-o", tmp_path / "o.png", "--json", *options).error
    assert message in error


def test_views_are_of_heads(mien: Mien, tmp_path: Path) -> None:
    asking = ("synthesize", tmp_path, "-o", tmp_path / "o.png", "--points", "a.json", "--json")
    error = mien(*asking, "--yaw", "9").error
    assert error == "--yaw: expected this only with a head folder, got 9.0"
