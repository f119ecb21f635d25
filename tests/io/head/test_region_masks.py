"""Region masks in a head folder: written, painted over, missing, broken."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.errors import FileFormatError
from mien.head import Expression, Head
from mien.io.head.head_folder import load_head, save_head
from mien.rig.regions import MASK_NAMES, default_masks
from mien.rig.rig import Rig
from mien.rig.state import FaceState

GENERIC = load_generic_head()
UP = np.array([0.0, 10.0, 0.0])
SKIN = GENERIC.mesh.vertices_of("skin")


@pytest.fixture(scope="module")
def masked() -> Head:
    """The generic head with its own masks, and a face that moves everything by 10 mm."""
    vertices = GENERIC.mesh.vertices
    return Head(
        subject="nobody",
        mesh=GENERIC.mesh,
        expressions={"neutral": Expression(vertices), "up": Expression(vertices + UP)},
        uncertainty_mm=np.ones(len(vertices)),
        unit_names=GENERIC.unit_names,
        unit_offsets=GENERIC.unit_offsets,
        textures={"atlas": np.full((8, 8, 3), 128, np.uint8)},
        regions=default_masks(GENERIC),
    )


@pytest.fixture
def folder(masked: Head, tmp_path: Path) -> Path:
    save_head(masked, tmp_path / "head")
    return tmp_path / "head"


def raised(head: Head, region: str) -> Array:
    """(V,) how far each vertex of the skin goes up, of 1, with a region in the other expression."""
    face = Rig(head).evaluate(FaceState({region: {"up": 1.0}}), contacts=False)
    return (face.vertices - head.mesh.vertices)[SKIN, 1] / 10


def test_masks_round_trip(masked: Head, folder: Path) -> None:
    found = load_head(folder).regions
    assert tuple(found) == MASK_NAMES
    off = np.abs([found[name] - masked.regions[name] for name in MASK_NAMES]).max(axis=0)
    assert (off <= 0.02).mean() > 0.95
    assert off.max() < 0.2, "between the smallest triangles, in the eye sockets"


def test_a_painted_mask_outlives_the_next_build(masked: Head, folder: Path) -> None:
    mask, other = (folder / "regions" / f"{name}.png" for name in ("left_eye", "left_mouth"))
    Image.new("L", (32, 32), 255).save(mask)
    painted, drawn = mask.read_bytes(), other.read_bytes()
    for _ in range(2):
        save_head(masked, folder)
        assert mask.read_bytes() == painted
        assert other.read_bytes() == drawn
    np.testing.assert_allclose(load_head(folder).regions["left_eye"], 1, atol=1e-6)


def test_a_painted_mask_changes_the_region(masked: Head, folder: Path) -> None:
    """White all over, in another size and kind of picture: that region is the whole head."""
    before = raised(load_head(folder), "left_forehead")
    assert before.min() < 0.01
    for name in MASK_NAMES:
        Image.new("L", (64, 48), 255 * (name == "left_forehead")).save(
            folder / "regions" / f"{name}.png"
        )
    head = load_head(folder)
    np.testing.assert_allclose(head.regions["left_forehead"], 1, atol=1e-6)
    np.testing.assert_allclose(raised(head, "left_forehead"), 1, atol=1e-6)
    np.testing.assert_allclose(raised(head, "right_mouth"), 0, atol=1e-6)


def test_where_masks_overlap_they_share(folder: Path) -> None:
    for name in MASK_NAMES:
        white = 255 * (name in ("left_eye", "right_eye"))
        Image.new("L", (16, 16), white).save(folder / "regions" / f"{name}.png")
    np.testing.assert_allclose(raised(load_head(folder), "left_eye"), 0.5, atol=1e-6)


def test_a_missing_mask_leaves_its_place_to_the_face(folder: Path) -> None:
    for name in ("left_mouth", "right_mouth"):
        (folder / "regions" / f"{name}.png").unlink()
    head = load_head(folder)
    assert set(head.regions) == set(MASK_NAMES) - {"left_mouth", "right_mouth"}
    np.testing.assert_allclose(raised(head, "mouth"), 0, atol=1e-6)
    lip = int(np.searchsorted(SKIN, GENERIC.vertex_of("upper_lip_outer.4")))
    assert raised(head, "face")[lip] == pytest.approx(1, abs=1e-6)


def test_without_any_masks_the_usual_ones_hold(masked: Head, tmp_path: Path) -> None:
    save_head(replace(masked, regions={}), tmp_path / "head")
    assert not (tmp_path / "head" / "regions").exists()
    head = load_head(tmp_path / "head")
    assert head.regions == {}
    np.testing.assert_allclose(raised(head, "mouth"), raised(masked, "mouth"), atol=1e-6)


@pytest.mark.parametrize("content", [b"", b"not a picture", None])
def test_a_broken_mask_is_named(folder: Path, content: bytes | None) -> None:
    path = folder / "regions" / "right_eye.png"
    path.write_bytes(path.read_bytes()[:300] if content is None else content)
    with pytest.raises(FileFormatError, match=r"right_eye\.png: expected an? .*image"):
        load_head(folder)


def test_other_files_beside_the_masks_do_no_harm(folder: Path) -> None:
    (folder / "regions" / "nose.png").write_bytes(b"mine")
    assert tuple(load_head(folder).regions) == MASK_NAMES
