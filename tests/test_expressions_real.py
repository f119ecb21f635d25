"""Heads of people who make faces before a camera: do pictures of them look like the footage?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.head import NEUTRAL
from mien.numeric.raster.rasterizer import interpolate
from mien.pipelines.build import Build, build_head
from mien.render.morph import MorphRenderer
from mien.render.picture import HeadRenderer
from mien.render.shade import rasterize_mesh, shown_parts
from mien.rig.regions import MASK_NAMES, default_masks
from mien.rig.rig import Rig
from mien.rig.state import FaceState, PosedFace

GENERIC = load_generic_head()


@dataclass(frozen=True)
class Filmed:
    """A head from a clip, and what draws it. photos: by name."""

    build: Build
    rig: Rig
    renderer: MorphRenderer
    photos: dict[str, Array]

    def expression(self, name: str) -> PosedFace:
        return self.rig.evaluate(FaceState({"face": {name: 1.0}}))

    def seen(self, face: PosedFace, values: Array, camera: Camera) -> tuple[Array, Array]:
        """(H, W) where the camera sees the head, and (H, W, C) the vertices' values there."""
        mesh = self.build.head.mesh.with_vertices(face.vertices)
        mesh = mesh.submesh(mesh.triangles_of(*shown_parts(mesh)))
        raster = rasterize_mesh(mesh, camera)
        return raster.mask, interpolate(raster, mesh.triangles, values)


@pytest.fixture(scope="module", params=["driving_d10", "cap13_edit2"])
def filmed(request: pytest.FixtureRequest, shared: Path) -> Filmed:
    """One command's worth: a head of a clip of somebody making faces."""
    clip = shared / "data" / "videos" / f"{request.param}.mp4"
    if not clip.is_file():
        pytest.skip(f"no {clip.name} in ../shared/data/videos")
    build = build_head(clip)
    rig = Rig(build.head)
    photos = {view.photo.name: view.photo.pixels for view in build.capture.views}
    return Filmed(build, rig, MorphRenderer(build.head.mesh, rig.textures), photos)


def test_at_least_five_expressions(filmed: Filmed) -> None:
    assert len(filmed.rig.names) >= 5
    rest = filmed.expression(NEUTRAL).vertices
    for name in filmed.rig.names[1:]:
        moved = np.linalg.norm(filmed.expression(name).vertices - rest, axis=1)
        assert moved.max() > 1.5, name


def fidelity(filmed: Filmed, name: str) -> float:
    """PSNR, dB, of the face in its own camera: the best of its photos, if there are several.

    The face is where both the head has it and the detector's landmarks surround it.
    """
    face, scores = filmed.expression(name), []
    outlines = {
        view.photo.name: cv2.convexHull(view.landmarks.points.astype(np.int32))
        for view in filmed.build.capture.views
        if view.landmarks
    }
    for view in filmed.build.head.expressions[name].views:
        photo = filmed.photos[view.photo].astype(float)
        drawn = filmed.renderer.render(face, view.camera)
        covered, share = filmed.seen(face, GENERIC.regions["face"][:, None], view.camera)
        inside = covered & (share[..., 0] > 0.5) & (drawn[..., 3] == 255)
        surrounded = np.zeros(inside.shape, np.uint8)
        inside &= cv2.fillConvexPoly(surrounded, outlines[view.photo], 1) > 0
        assert inside.sum() > 3000
        error = (drawn[..., :3] / view.gains - photo)[inside]
        scores.append(20 * np.log10(255 / np.sqrt((error**2).mean())))
    return max(scores)


def test_every_expression_looks_like_its_frame(filmed: Filmed) -> None:
    found = {name: fidelity(filmed, name) for name in filmed.rig.names}
    assert min(found.values()) >= 30, found


def test_nothing_jumps_on_the_way_to_an_expression(filmed: Filmed) -> None:
    """Contacts were resolved when it was built: they leave it as it is."""
    for name in filmed.rig.names[1:]:
        near = filmed.rig.evaluate(FaceState({"face": {name: 1 - 1e-5}}))
        off = np.linalg.norm(near.vertices - filmed.expression(name).vertices, axis=1)
        assert off.max() < 0.1, name


@dataclass(frozen=True)
class Steps:
    """Colour steps between neighbouring pixels of one picture, 0 to 255.

    Attributes:
        everywhere: two arrays, down and across.
        border: pairs on a border of regions of the face.
        within: pairs on the head and on no border.
    """

    everywhere: tuple[Array, Array]
    border: tuple[Array, Array]
    within: tuple[Array, Array]

    def at(self, pairs: tuple[Array, Array]) -> Array:
        return np.concatenate([s[p] for s, p in zip(self.everywhere, pairs, strict=True)])


def pairs(mask: Array) -> tuple[Array, Array]:
    """Neighbours that are both in the mask."""
    return mask[:-1] & mask[1:], mask[:, :-1] & mask[:, 1:]


def steps(filmed: Filmed, face: PosedFace, camera: Camera) -> Steps:
    masks = default_masks(GENERIC)
    half = [masks[name] for name in MASK_NAMES]
    whole = [half[2 * k] + half[2 * k + 1] for k in range(3)]
    covered, shares = filmed.seen(face, np.column_stack([*whole, GENERIC.regions["face"]]), camera)
    mixed = ((shares[..., :3] > 0.05) & (shares[..., :3] < 0.95)).any(axis=2)
    picture = filmed.renderer.render(face, camera, samples=1)[..., :3].astype(int)
    down, across = (np.abs(np.diff(picture, axis=axis)).max(axis=2) for axis in (0, 1))
    border = pairs(covered & mixed & (shares[..., 3] > 0.5))
    return Steps((down, across), border, pairs(covered & ~mixed))


def one_texture(filmed: Filmed, face: PosedFace, name: str) -> PosedFace:
    """The same shape with one expression's texture all over."""
    weights = np.zeros_like(face.weights)
    weights[:, filmed.rig.names.index(name)] = 1
    return PosedFace(face.vertices, weights, face.brightness)


def test_regions_have_no_visible_borders(filmed: Filmed) -> None:
    """In mixtures of one expression's mouth, another's eyes and a third one's forehead.

    No step across a border is as large as those within the regions; nor are steps larger than
    those that the textures have there by themselves.
    """
    names, camera = filmed.rig.names, HeadRenderer(filmed.build.head).camera(size=(400, 500))
    for k in range(len(names)):
        mouth, eyes, forehead = (names[(k + j) % len(names)] for j in (0, 2, 3))
        state = {"mouth": {mouth: 1.0}, "eyes": {eyes: 1.0}, "forehead": {forehead: 1.0}}
        face = filmed.rig.evaluate(FaceState(state))
        found = steps(filmed, face, camera)
        across = found.at(found.border)
        assert len(across) > 3000
        assert across.max() <= found.at(found.within).max(), state
        by_themselves = np.stack(
            [
                steps(filmed, one_texture(filmed, face, name), camera).at(found.border)
                for name in {NEUTRAL, mouth, eyes, forehead}
            ]
        )
        usual = np.percentile(by_themselves, 99.9, axis=1).max()
        assert np.percentile(across, 99.9) <= 1.1 * usual, state
        added = across - by_themselves.max(axis=0)
        assert np.percentile(added, 99.9) <= 8, state
