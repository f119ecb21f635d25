from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.arrays import Array
from mien.errors import InputError
from mien.texture.atlas import atlas_surface
from mien.texture.blend import Blend
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.fill import alpha_composite, blend_over, build_skin_fill, fill_image, fill_part
from mien.texture.parts import REGION_COLOURS
from mien.texture.surface import part_mask
from shapes import ellipsoid, with_nose


def uniform(colour: tuple[int, int, int], confidence: Array) -> Blend:
    colours = np.broadcast_to(np.float32(colour), (*confidence.shape, 3)).copy()
    return Blend(colours, confidence.astype(np.float32), confidence.astype(np.float32))


def test_one_blend_over_another() -> None:
    upper = uniform((200, 0, 0), np.array([[1.0, 0.5, 0.0, 0.0]]))
    lower = uniform((0, 100, 0), np.array([[1.0, 1.0, 0.5, 0.0]]))
    both = blend_over(upper, lower)
    np.testing.assert_allclose(both.confidence, [[1, 1, 0.5, 0]])
    np.testing.assert_allclose(both.colours[0, :3], [[200, 0, 0], [100, 50, 0], [0, 100, 0]])


def test_mixing_is_linear_in_the_confidence() -> None:
    mixed = alpha_composite(np.full((1, 3, 3), 100.0), np.zeros(3), np.array([[0, 0.25, 1]]))
    np.testing.assert_allclose(mixed[0, :, 0], [0, 25, 100])


@pytest.mark.parametrize("fill", ["pyramid", "grow"])
def test_certain_colours_stay(fill: str, rng: np.random.Generator) -> None:
    confidence = (rng.random((20, 30)) > 0.6).astype(np.float32)
    blend = Blend(rng.random((20, 30, 3)).astype(np.float32), confidence, confidence)
    filled = fill_image(blend, fill, wrap=True)
    np.testing.assert_allclose(filled[confidence > 0], blend.colours[confidence > 0], atol=1e-6)


def test_a_part_fades_to_its_own_colour() -> None:
    confidence = np.zeros((96, 96))
    confidence[40:56, 40:56] = 1
    filled = fill_part(uniform((100, 50, 20), confidence), np.full(3, 200.0), 10)
    np.testing.assert_allclose(filled[48, 48], [100, 50, 20], atol=1e-4)
    assert abs(filled[48, 58, 0] - 100) < 50
    assert abs(filled[48, 90, 0] - 200) < 10
    flat = fill_part(uniform((100, 50, 20), confidence), np.full(3, 200.0), 0)
    np.testing.assert_allclose(flat[48, 57], 200)


def test_regions_do_not_run_into_each_other() -> None:
    mesh = ellipsoid()
    cylinder = fit_cylinder(mesh)
    coarse = cylinder_surface(mesh, cylinder, width=128, height=64)
    hair = np.clip((mesh.vertices[:, 1] - 30) / 10, 0, 1)
    mouth = ((mesh.vertices[:, 2] > 70) & (mesh.vertices[:, 1] < 0)).astype(float)
    blend = uniform((180, 130, 110), coarse.points[..., 2] > 0)
    blend.colours[coarse.points[..., 1] > 35] = (30, 25, 20)
    regions = {"scalp": hair, "neck": 1 - hair, "mouth_cavity": mouth}
    skin_fill = build_skin_fill(coarse, mesh, blend, cylinder, "pyramid", regions)
    np.testing.assert_allclose(skin_fill.masks.sum(axis=0), 1, atol=1e-9)
    surface = atlas_surface(mesh, width=100, height=80)
    colours = np.zeros((80, 100, 3), np.float32)
    colours[surface.mask] = skin_fill.colours(surface, mesh, surface.mask)
    y, back = surface.points[..., 1], surface.points[..., 2] < -10
    np.testing.assert_allclose(colours[back & (y > 45)], [[30, 25, 20]] * (back & (y > 45)).sum())
    skin = back & (y < 25)
    np.testing.assert_allclose(colours[skin], [[180, 130, 110]] * skin.sum(), atol=1e-3)
    lips = (surface.points[..., 2] > 85) & (y < -10)
    np.testing.assert_allclose(colours[lips], [REGION_COLOURS["mouth_cavity"]] * lips.sum())


def test_a_mask_of_another_mesh_is_refused() -> None:
    mesh = ellipsoid()
    cylinder = fit_cylinder(mesh)
    coarse = cylinder_surface(mesh, cylinder, width=64, height=32)
    blend = uniform((1, 2, 3), coarse.mask)
    with pytest.raises(InputError, match=r"scalp: expected shape \(3321\), got shape \(5,\)"):
        build_skin_fill(coarse, mesh, blend, cylinder, "pyramid", {"scalp": np.zeros(5)})


def test_the_hair_cap_takes_the_colours_of_the_scalp() -> None:
    mesh = with_nose(ellipsoid())
    hairy = replace(mesh, part_names=("skin", "hair"))
    cylinder = fit_cylinder(hairy)
    coarse = cylinder_surface(hairy, cylinder, width=128, height=64, parts=("skin",))
    scalp = np.clip((mesh.vertices[:, 1] - 30) / 10, 0, 1)
    blend = uniform((180, 130, 110), coarse.mask)
    blend.colours[coarse.points[..., 1] > 35] = (30, 25, 20)
    skin_fill = build_skin_fill(coarse, hairy, blend, cylinder, "pyramid", {"scalp": scalp})
    surface = atlas_surface(hairy, width=200, height=80)
    hair = part_mask(surface, hairy, "hair")
    colours = skin_fill.colours(surface, hairy, hair)
    np.testing.assert_allclose(colours, [[30, 25, 20]] * hair.sum(), atol=1e-3)
