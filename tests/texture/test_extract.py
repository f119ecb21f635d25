from __future__ import annotations

import numba
import numpy as np
import pytest

from mien.arrays import Array
from mien.camera import Camera
from mien.errors import EstimationError, InputError
from mien.mesh import Mesh
from mien.render.shade import render
from mien.texture.atlas import atlas_surface
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.extract import extract_texture
from mien.texture.parts import STYLES
from shapes import camera_at, ellipsoid, smooth_texture, with_cylinder_uvs, with_nose

YAWS = (-50, 0, 50)


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return ellipsoid()


@pytest.fixture(scope="module")
def cameras(mesh: Mesh) -> list[Camera]:
    return [camera_at(yaw, mesh) for yaw in YAWS]


@pytest.fixture(scope="module")
def photos(mesh: Mesh, cameras: list[Camera]) -> list[Array]:
    truth = smooth_texture()
    return [photo(mesh, camera, truth) for camera in cameras]


def photo(mesh: Mesh, camera: Camera, texture: Array, gain: Array | float = 1.0) -> Array:
    image = render(mesh, camera, texture, samples=4, background=(90, 120, 90))[..., :3]
    return np.clip(np.rint(image * gain), 0, 255).astype(np.uint8)


def psnr(one: Array, other: Array) -> float:
    return float(10 * np.log10(255**2 / np.mean((one.astype(float) - other) ** 2)))


@pytest.mark.parametrize("layout", ["atlas", "cylinder"])
def test_a_new_view_matches_the_ground_truth(
    mesh: Mesh, cameras: list[Camera], photos: list[Array], layout: str
) -> None:
    # Photos at -50, 0 and 50 degrees, a new view at 25. Rounding to 8 bits three times (photo,
    # texture, new view) alone leaves 54 dB; resampling waves of some 20 texels adds little.
    if layout == "atlas":
        surface, shown = atlas_surface(mesh, width=768, height=512), mesh
    else:
        cylinder = fit_cylinder(mesh)
        surface = cylinder_surface(mesh, cylinder, width=768, height=384)
        shown = with_cylinder_uvs(mesh, cylinder)
    texture = extract_texture(mesh, cameras, photos, surface=surface)
    camera = camera_at(25, mesh)
    again = render(shown, camera, texture.pixels, samples=4)
    truth = render(mesh, camera, smooth_texture(), samples=4)
    inner = truth[..., 3] == 255
    # Poles and rim are seen at a grazing angle by every photo and are filled, not photographed.
    inner[:45] = inner[-45:] = False
    assert psnr(again[inner][:, :3], truth[inner][:, :3]) > 48


@pytest.mark.parametrize("fill", ["pyramid", "grow"])
def test_constant_photos_give_a_constant_texture(
    mesh: Mesh, cameras: list[Camera], fill: str
) -> None:
    surface = atlas_surface(mesh, width=128, height=96)
    grey = np.full((320, 320, 3), (200, 150, 120), np.uint8)
    texture = extract_texture(mesh, cameras, [grey] * 3, surface=surface, fill=fill)
    assert np.abs(texture.pixels.astype(int) - (200, 150, 120)).max() <= 1


def test_what_no_photo_sees_stays_black_without_filling(mesh: Mesh, cameras: list[Camera]) -> None:
    surface = atlas_surface(mesh, width=128, height=96)
    white = np.full((320, 320, 3), 255, np.uint8)
    texture = extract_texture(mesh, cameras[1:2], [white], surface=surface, fill="none")
    back = surface.points[..., 2] < -10
    assert not texture.pixels[back].any()
    assert not texture.coverage[back].any()
    assert (texture.pixels[texture.coverage > 0] >= 254).all()


def test_ends_of_the_cylinder_agree(mesh: Mesh, cameras: list[Camera], photos: list[Array]) -> None:
    surface = cylinder_surface(mesh, fit_cylinder(mesh), width=512, height=256)
    pixels = extract_texture(mesh, cameras, photos, surface=surface).pixels.astype(int)
    assert np.abs(pixels[:, 0] - pixels[:, -1]).max() <= 4


def test_exposure_and_white_balance_are_equalized(mesh: Mesh, cameras: list[Camera]) -> None:
    gains = np.array([[0.8, 0.9, 0.85], [1, 1, 1], [1.1, 1.15, 1.25]])
    truth = smooth_texture() // 2 + 40
    seen = [photo(mesh, camera, truth, gain) for camera, gain in zip(cameras, gains, strict=True)]
    surface = atlas_surface(mesh, width=256, height=192)
    texture = extract_texture(mesh, cameras, seen, surface=surface)
    np.testing.assert_allclose(np.prod(texture.gains, axis=0), 1, atol=1e-6)
    products = texture.gains * gains
    np.testing.assert_allclose(products / products[1], 1, atol=0.02)
    plain = extract_texture(mesh, cameras, seen, surface=surface, equalize=False)
    np.testing.assert_array_equal(plain.gains, 1)


def test_photos_that_share_nothing_keep_their_colours(mesh: Mesh) -> None:
    cameras = [camera_at(0, mesh), camera_at(180, mesh)]
    bright, dark = (np.full((320, 320, 3), level, np.uint8) for level in (200, 100))
    surface = atlas_surface(mesh, width=128, height=96)
    texture = extract_texture(mesh, cameras, [bright, dark], surface=surface)
    np.testing.assert_array_equal(texture.gains, 1)


def test_the_other_side_is_taken_from_the_mirror(mesh: Mesh) -> None:
    index = np.arange(len(mesh.vertices)).reshape(41, 81)
    mirror = index[:, ::-1].copy()
    mirror[:, 0] = index[:, 0]
    texture = smooth_texture()
    symmetric = np.hstack([texture[:, :256], texture[:, 255::-1]])
    left = camera_at(60, mesh)
    taken = photo(mesh, left, symmetric)
    surface = atlas_surface(mesh, width=512, height=256)
    found = extract_texture(mesh, [left], [taken], surface=surface, mirror=mirror.ravel())
    right = camera_at(-60, mesh)
    again, truth = render(mesh, right, found.pixels), render(mesh, right, symmetric)
    inner = truth[60:-60, 110:-110]
    assert psnr(again[60:-60, 110:-110, :3], inner[..., :3]) > 48


def test_parts_do_not_bleed_into_each_other(mesh: Mesh) -> None:
    both = with_nose(mesh)
    both = Mesh(
        both.vertices,
        both.triangles,
        both.uvs,
        both.uv_triangles,
        both.part,
        ("skin", "tongue"),
    )
    camera = camera_at(180, both)  # From behind: the ball before the face is out of sight.
    white = np.full((320, 320, 3), 255, np.uint8)
    surface = atlas_surface(both, width=256, height=128)
    texture = extract_texture(both, [camera], [white], surface=surface)
    assert (texture.pixels[:, 205:256] == STYLES["tongue"].default).all()
    assert (texture.pixels[:, :192] == 255).all()


def test_regions_are_filled_from_themselves(mesh: Mesh) -> None:
    truth = np.full((256, 512, 3), (180, 130, 110), np.uint8)
    truth[:90] = (30, 25, 20)  # Hair above 27 degrees of latitude.
    scalp = np.clip((mesh.uvs[:, 1] - 0.62) / 0.06, 0, 1)  # Half in the region at the hairline.
    regions = {"scalp": scalp, "neck": 1 - scalp}
    camera = camera_at(0, mesh)
    taken = photo(mesh, camera, truth)
    surface = atlas_surface(mesh, width=256, height=128)
    texture = extract_texture(mesh, [camera], [taken], surface=surface, regions=regions)
    back = texture.pixels[:, :20].astype(int)
    assert np.abs(back[5:38] - (30, 25, 20)).max() < 12
    assert np.abs(back[52:120] - (180, 130, 110)).max() < 12


def test_same_bytes_whatever_the_number_of_threads(
    mesh: Mesh, cameras: list[Camera], photos: list[Array]
) -> None:
    surface = atlas_surface(mesh, width=256, height=192)
    before = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = extract_texture(mesh, cameras, photos, surface=surface)
    finally:
        numba.set_num_threads(before)
    shared = extract_texture(mesh, cameras, photos, surface=surface)
    assert alone.pixels.tobytes() == shared.pixels.tobytes()
    assert alone.coverage.tobytes() == shared.coverage.tobytes()


def test_bad_input_is_refused(mesh: Mesh, cameras: list[Camera], photos: list[Array]) -> None:
    surface = atlas_surface(mesh, width=64, height=64)
    with pytest.raises(InputError, match="photos: expected 3 of them, one a camera, got 2"):
        extract_texture(mesh, cameras, photos[:2], surface=surface)
    with pytest.raises(InputError, match="fill: expected pyramid or grow or none, got smear"):
        extract_texture(mesh, cameras, photos, surface=surface, fill="smear")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="feather_mm: expected a number above zero"):
        extract_texture(mesh, cameras, photos, surface=surface, feather_mm=0)
    away = mesh.with_vertices(mesh.vertices + np.array([0, 0, 9000]))
    with pytest.raises(EstimationError, match="no photo sees the head"):
        extract_texture(away, cameras, photos, surface=atlas_surface(away, width=64, height=64))
