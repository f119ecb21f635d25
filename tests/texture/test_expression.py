"""Expressions photographed off textures that are known, by cameras that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.mesh import Mesh
from mien.render.shade import render
from mien.texture.atlas import atlas_surface
from mien.texture.expression import TextureLayer, extract_expression_layer
from mien.texture.surface import SurfaceMap, interpolate_vertex_values
from shapes import camera_at, ellipsoid, smooth_texture, with_nose

SIZE = (512, 256)
MESH = ellipsoid()
SURFACE = atlas_surface(MESH, width=SIZE[0], height=SIZE[1])
FRONT = camera_at(0, MESH, size=400)
EVERYWHERE, NOWHERE = np.ones(len(MESH.vertices)), np.zeros(len(MESH.vertices))


def resting() -> Array:
    """(H, W, 3) neutral's texture."""
    return np.asarray(smooth_texture(*SIZE) // 2 + 60, np.uint8)


def wrinkled() -> Array:
    """The same but for a patch on the face, brighter and redder."""
    texture = resting()
    texture[110:150, 236:276] = texture[110:150, 236:276] // 2 + np.array([90, 40, 40], np.uint8)
    return texture


def photo(
    texture: Array, seen_from: Camera = FRONT, *, mesh: Mesh = MESH, exposure: Array | float = 1.0
) -> Array:
    image = render(mesh, seen_from, texture, samples=4, background=(10, 130, 30))[..., :3]
    return np.clip(np.rint(image * exposure), 0, 255).astype(np.uint8)


def look(
    photos: list[Array],
    cameras: list[Camera] | None = None,
    *,
    within: Array = EVERYWHERE,
    inside: Array | None = None,
    below: Array | None = None,
    mesh: Mesh = MESH,
    surface: SurfaceMap = SURFACE,
) -> TextureLayer:
    return extract_expression_layer(
        mesh,
        cameras or [FRONT],
        photos,
        surface=surface,
        below=resting() if below is None else below,
        within=within,
        inside=np.zeros(len(mesh.vertices)) if inside is None else inside,
    )


@pytest.fixture(scope="module")
def found() -> TextureLayer:
    return look([photo(wrinkled())])


def off(texture: Array, true: Array) -> Array:
    """(H, W) largest difference of a channel, grey levels."""
    return np.abs(texture.astype(int) - true).max(axis=2)


def test_visible_texels_show_the_expression(found: TextureLayer) -> None:
    texture = found.over(resting(), SURFACE)
    sure = found.opacity > 0.99
    assert sure[110:150, 236:276].all(), "the patch is in the middle of the face"
    assert off(wrinkled(), resting())[110:150, 236:276].mean() > 20
    assert np.median(off(texture, wrinkled())[sure]) <= 2
    assert np.percentile(off(texture, wrinkled())[sure], 95) <= 6
    assert sure.mean() > 0.15


def test_holes_show_neutral(found: TextureLayer) -> None:
    texture = found.over(resting(), SURFACE)
    away = FRONT.center - SURFACE.points
    back = (SURFACE.normals * away).sum(axis=2) < 0
    assert back.mean() > 0.4
    assert not found.opacity[back].any()
    assert not found.confidence[back].any()
    np.testing.assert_array_equal(texture[back], resting()[back])


def test_the_two_textures_meet_in_a_ramp(found: TextureLayer) -> None:
    """Along the equator, from the side into the face: nothing jumps."""
    row = found.opacity[SIZE[1] // 2, : SIZE[0] // 2]
    first, last = np.flatnonzero(row > 0)[0], np.flatnonzero(row < 1)[-1]
    assert (np.diff(row[first : last + 1]) >= 0).all()
    across = np.linalg.norm(np.diff(SURFACE.points[SIZE[1] // 2, first : last + 2], axis=0), axis=1)
    assert 8 < across.sum() < 20, "mm"
    assert np.abs(np.diff(row)).max() < 0.2


def test_outside_the_mask_the_texture_is_neutral() -> None:
    within = np.clip(0.5 + MESH.vertices[:, 1] / 20, 0, 1)
    part = look([photo(wrinkled())], within=within)
    mask = interpolate_vertex_values(SURFACE, MESH, within[:, None])[..., 0]
    texture = part.over(resting(), SURFACE)
    np.testing.assert_array_equal(texture[mask == 0], resting()[mask == 0])
    assert (part.opacity <= mask + 1e-6).all()
    whole = look([photo(wrinkled())])
    np.testing.assert_allclose(part.opacity, whole.opacity * mask, atol=1e-6)


def test_surfaces_behind_the_lips_are_visible_through_slits(found: TextureLayer) -> None:
    """A wide ramp would leave nothing of it."""
    slit = look([photo(wrinkled())], inside=EVERYWHERE)
    assert (slit.opacity > 0.99).sum() > 1.2 * (found.opacity > 0.99).sum()
    assert (slit.opacity >= found.opacity - 1e-6).all()
    sure = slit.opacity > 0.99
    assert np.median(off(slit.over(resting(), SURFACE), wrinkled())[sure]) <= 2


@pytest.mark.parametrize("exposure", [(0.8, 0.8, 0.8), (1.2, 1.0, 0.85)])
def test_exposure_and_white_balance_are_neutrals(exposure: tuple[float, ...]) -> None:
    found = look([photo(wrinkled(), exposure=np.array(exposure))])
    np.testing.assert_allclose(found.gains, [1 / np.array(exposure)], rtol=0.02)
    sure = found.opacity > 0.99
    texture = found.over(resting(), SURFACE)
    assert np.median(off(texture, wrinkled())[sure]) <= 2


def test_gains_are_limited() -> None:
    """A photo in the dark is no photo of a face in the light."""
    dark = look([photo(wrinkled(), exposure=0.3)])
    np.testing.assert_allclose(dark.gains, 1.6)


def test_without_shared_skin_exposure_stays() -> None:
    found = look([photo(wrinkled(), exposure=0.7)], within=NOWHERE)
    np.testing.assert_array_equal(found.gains, 1)
    np.testing.assert_array_equal(found.over(resting(), SURFACE), resting())


def test_photos_of_unlike_exposure_agree() -> None:
    cameras = [camera_at(yaw, MESH, size=400) for yaw in (-35, 35)]
    exposures = (0.8, 1.15)
    photos = [
        photo(wrinkled(), item, exposure=gain)
        for item, gain in zip(cameras, exposures, strict=True)
    ]
    found = look(photos, cameras)
    np.testing.assert_allclose(found.gains, [[1 / gain] * 3 for gain in exposures], rtol=0.02)
    sure = found.opacity > 0.99
    texture = found.over(resting(), SURFACE)
    assert np.median(off(texture, wrinkled())[sure]) <= 2
    assert np.percentile(off(texture, wrinkled())[sure], 99) <= 8, "no seam between them"
    assert sure.mean() > 0.3


def test_eyes_are_textured_separately() -> None:
    """A ball before the face that is the photo's, whatever is behind it."""
    mesh = replace(with_nose(MESH), part_names=("skin", "left_eyeball"))
    surface = atlas_surface(mesh, width=SIZE[0], height=SIZE[1])
    seen_from = camera_at(0, mesh, size=400)
    ball = np.zeros((SIZE[1], SIZE[0]), bool)
    ball[:, int(0.78 * SIZE[0]) :] = True
    below, true = (np.full((SIZE[1], SIZE[0], 3), 120, np.uint8) for _ in range(2))
    true[ball] = (200, 60, 40)
    within = np.ones(len(mesh.vertices))
    image = photo(true, seen_from, mesh=mesh)
    found = look([image], [seen_from], within=within, below=below, mesh=mesh, surface=surface)
    texture = found.over(below, surface)
    facing = ball & (surface.normals[..., 2] > 0.7) & surface.mask
    assert facing.sum() > 300
    assert np.median(off(texture, true)[facing]) <= 2
    behind = ball & (surface.normals[..., 2] < -0.3) & surface.mask
    np.testing.assert_array_equal(texture[behind], below[behind])
    np.testing.assert_allclose(found.gains, 1, atol=0.01, err_msg="skin alone tells exposure")


def made_up(tone: int, share: Array) -> TextureLayer:
    colours = np.full((*share.shape, 3), tone, np.float32)
    return TextureLayer(colours, share, (share > 0).astype(np.float32), np.ones((1, 3)))


def test_layers_are_composited_by_opacity(rng: np.random.Generator) -> None:
    share = rng.uniform(0, 1, size=(SIZE[1], SIZE[0])).astype(np.float32)
    below = rng.integers(0, 256, size=(SIZE[1], SIZE[0], 3), dtype=np.uint8)
    mixed = made_up(200, share).over(below, SURFACE)
    expected = below + share[..., None] * (200.0 - below)
    assert np.abs(mixed - expected)[SURFACE.mask].max() <= 0.51
    np.testing.assert_array_equal(
        made_up(200, 0 * share).over(below, SURFACE)[SURFACE.mask], below[SURFACE.mask]
    )


def test_layers_are_merged() -> None:
    shape = SIZE[1], SIZE[0]
    left, right = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    left[:, :300], right[:, 200:] = 1, 1
    both = made_up(50, left).merged_with(made_up(150, right))
    np.testing.assert_allclose(both.opacity, 1)
    np.testing.assert_allclose(both.colours[:, :200], 50)
    np.testing.assert_allclose(both.colours[:, 200:300], 100)
    np.testing.assert_allclose(both.colours[:, 300:], 150)
    assert both.gains.shape == (2, 3)
