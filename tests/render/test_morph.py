from __future__ import annotations

import numba
import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import interpolate
from mien.render.morph import MorphRenderer
from mien.render.shade import rasterize_mesh, render
from mien.rig.state import PosedFace
from shapes import camera_at, ellipsoid, with_nose

MESH = ellipsoid(60, 120)
COUNT = len(MESH.vertices)


def waves(seed: int) -> Array:
    """A smooth texture of any colours that goes around without a seam."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid((np.arange(512) + 0.5) / 512, (np.arange(256) + 0.5) / 256)
    phase = rng.uniform(0, 6, 3)
    turns = rng.integers(1, 3, 3)
    channels = [np.cos(2 * np.pi * n * u + 3 * v + p) for n, p in zip(turns, phase, strict=True)]
    return np.rint(127.5 + 127 * np.stack(channels, axis=2)).astype(np.uint8)


TEXTURES = [waves(seed) for seed in range(4)]


def face(weights: Array, brightness: Array | None = None, mesh: Mesh = MESH) -> PosedFace:
    light = np.ones(len(mesh.vertices)) if brightness is None else brightness
    return PosedFace(mesh.vertices, weights, light)


def regions(rng: np.random.Generator, low: float, high: float) -> Array:
    """(V, 4) weights that differ by region, sum to 1 and are one-hot over the back."""
    _, y, z = MESH.vertices.T
    soft = 1 / (1 + np.exp(-z / 6))
    masks = soft * np.stack([y < -20, abs(y) <= 20, y > 20]) * (z > -30)
    weights = masks.T @ rng.uniform(low, high, (3, 4))
    weights[:, 0] += 1 - weights.sum(axis=1)
    return weights


def passes(posed: PosedFace, camera: Camera, factor: int) -> Array:
    """Slow and obvious: one float picture a texture, weighted, summed; then pixels; then 0 to 255.

    Returns:
        (H, W, 4), not rounded; NaN where a pixel is not wholly covered.
    """
    mesh = MESH.with_vertices(posed.vertices)
    raster = rasterize_mesh(mesh, camera.resized(factor))
    corners = np.concatenate([mesh.uvs, np.zeros((1, 2))])[mesh.uv_triangles[raster.triangle_ids]]
    uv = np.einsum("hwk,hwkc->hwc", raster.barycentrics, corners)
    shares = interpolate(raster, mesh.triangles, posed.weights)
    light = interpolate(raster, mesh.triangles, posed.brightness[:, None])
    total = np.zeros((*raster.depth.shape, 3))
    for k, texture in enumerate(TEXTURES):
        total += shares[..., k, None] * bilinear(texture, uv)
    total *= light
    total[~raster.mask] = np.nan
    size = (camera.height, factor, camera.width, factor, 3)
    return np.clip(total.reshape(size).mean(axis=(1, 3)), 0, 255)


def bilinear(texture: Array, uv: Array) -> Array:
    height, width = texture.shape[:2]
    x, y = uv[..., 0] * width - 0.5, np.clip((1 - uv[..., 1]) * height - 0.5, 0, height - 1.001)
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    wide = np.concatenate([texture, texture[:, :1]], axis=1).astype(float)
    x0 %= width
    upper = (1 - fx) * wide[y0, x0] + fx * wide[y0, x0 + 1]
    return (1 - fy) * upper + fy * ((1 - fx) * wide[y0 + 1, x0] + fx * wide[y0 + 1, x0 + 1])


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.4), (-0.5, 1.5)])
@pytest.mark.parametrize("samples", [1, 4, 9])
def test_one_pass_equals_the_sum_of_passes(
    rng: np.random.Generator, low: float, high: float, samples: int
) -> None:
    brightness = np.clip(1.1 - MESH.vertices[:, 1] / 150, 0.4, 1.3)
    posed = face(regions(rng, low, high), brightness)
    camera = camera_at(25, MESH, size=240)
    image = MorphRenderer(MESH, TEXTURES).render(posed, camera, samples=samples)
    expected = passes(posed, camera, int(np.sqrt(samples)))
    # The poles squeeze the texture into a point; an outline is another question.
    inner = np.isfinite(expected[..., 0])
    inner[:40] = inner[200:] = False
    difference = np.abs(image[..., :3] - expected)[inner]
    assert inner.sum() > 15_000
    assert np.percentile(difference, 99.5) <= 1
    assert difference.max() <= 3
    if low < 0:
        assert (expected[inner] == 0).any()
        assert (expected[inner] == 255).any()


def test_a_texture_alone_is_that_texture(rng: np.random.Generator) -> None:
    camera = camera_at(-20, MESH, size=200)
    renderer = MorphRenderer(MESH, TEXTURES)
    for k, texture in enumerate(TEXTURES):
        posed = face(np.tile(np.eye(4)[k], (COUNT, 1)))
        alone = render(MESH, camera, texture, samples=4)
        np.testing.assert_array_equal(renderer.render(posed, camera), alone)


def test_equal_textures_hide_the_weights(rng: np.random.Generator) -> None:
    camera = camera_at(10, MESH, size=200)
    mixed = MorphRenderer(MESH, [TEXTURES[0]] * 4).render(face(regions(rng, -0.5, 1.5)), camera)
    alone = render(MESH, camera, TEXTURES[0], samples=4).astype(int)
    assert np.abs(mixed - alone).max() <= 1


@pytest.mark.parametrize("samples", [1, 4, 9])
def test_alpha_is_the_covered_share_and_colours_are_straight(samples: int) -> None:
    mesh = with_nose(MESH)
    camera = camera_at(80, mesh, size=150)
    plain = np.full((64, 64, 3), (10, 200, 90), np.uint8)
    posed = face(np.ones((len(mesh.vertices), 1)), mesh=mesh)
    image = MorphRenderer(mesh, [plain]).render(posed, camera, samples=samples)
    clay = render(mesh, camera, samples=samples)
    np.testing.assert_array_equal(image[..., 3], clay[..., 3])
    assert (image[image[..., 3] > 0][:, :3] == (10, 200, 90)).all()
    assert not image[image[..., 3] == 0].any()


def test_the_result_does_not_depend_on_threads(rng: np.random.Generator) -> None:
    renderer, posed = MorphRenderer(MESH, TEXTURES), face(regions(rng, -0.5, 1.5))
    camera = camera_at(40, MESH, size=300)
    before = numba.get_num_threads()
    pictures = []
    for threads in {1, before}:
        numba.set_num_threads(threads)
        pictures.append(renderer.render(posed, camera).tobytes())
    numba.set_num_threads(before)
    assert len(set(pictures)) == 1


def test_geometry_is_the_faces_not_the_meshs(rng: np.random.Generator) -> None:
    weights = regions(rng, 0, 0.4)
    posed = PosedFace(MESH.vertices * [1.2, 0.9, 1], weights, np.ones(COUNT))
    camera = camera_at(0, MESH, size=128)
    wide = MESH.with_vertices(posed.vertices)
    alpha = MorphRenderer(MESH, TEXTURES).render(posed, camera)[..., 3]
    np.testing.assert_array_equal(alpha, render(wide, camera, samples=4)[..., 3])


def test_parts_and_backgrounds() -> None:
    mesh = with_nose(MESH)
    camera = camera_at(0, mesh, size=100)
    posed = face(np.ones((len(mesh.vertices), 1)), mesh=mesh)
    nose = MorphRenderer(mesh, TEXTURES[:1], parts=("nose",)).render(
        posed, camera, background=(1, 2, 3)
    )
    assert (nose[..., 3] == 255).all()
    assert (nose[10, 50, :3] == (1, 2, 3)).all()
    assert (nose[50, 50, :3] != (1, 2, 3)).any()


def test_a_face_outside_the_picture_or_behind_the_camera_shows_nothing() -> None:
    camera, renderer = camera_at(0, MESH, size=64), MorphRenderer(MESH, TEXTURES[:1])
    for shift in ((900.0, 0, 0), (0, 0, 5000.0)):
        posed = PosedFace(MESH.vertices + shift, np.ones((COUNT, 1)), np.ones(COUNT))
        assert not renderer.render(posed, camera).any()


def test_bad_input_is_refused() -> None:
    camera, renderer = camera_at(0, MESH, size=32), MorphRenderer(MESH, TEXTURES)
    with pytest.raises(InputError, match=r"face: expected weights of shape \(7381, 4\), got shape"):
        renderer.render(face(np.ones((COUNT, 3))), camera)
    with pytest.raises(InputError, match="samples: expected 1 or 4 or 9, got 2"):
        renderer.render(face(np.ones((COUNT, 4))), camera, samples=2)
    with pytest.raises(InputError, match="mesh: expected one with texture coordinates"):
        MorphRenderer(Mesh(MESH.vertices, MESH.triangles), TEXTURES)
    with pytest.raises(InputError, match="part: expected skin, got ears"):
        MorphRenderer(MESH, TEXTURES, parts=("ears",))
