from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from marbled import GENERIC, at
from mien.arrays import Array
from mien.camera import Camera
from mien.head import SHADING
from mien.render.shade import render
from mien.rig.expression_textures import (
    ExpressionPhotos,
    ExpressionTextures,
    extract_expression_textures,
)
from mien.rig.shading import OpeningMeter, brightness_at
from mien.texture.atlas import atlas_surface
from mien.texture.surface import part_mask
from posable import REST, explained_by

SIDE = 512
SURFACE = atlas_surface(GENERIC.mesh, width=SIDE, height=SIDE)
PARTS = {"left_eyeball": 0, "right_eyeball": 1, "upper_teeth": 2, "lower_teeth": 2}
"""The openings that shade them."""
SKIN, EYES, TEETH = (190, 150, 130), (170, 190, 210), (210, 200, 160)
"""In full light."""
SHAPES = {
    "neutral": REST,
    "asleep": explained_by({"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}),
    "awe": explained_by(
        {
            "jawOpen": 0.35,
            "mouthUpperUpLeft": 1,
            "mouthUpperUpRight": 1,
            "mouthLowerDownLeft": 1,
            "mouthLowerDownRight": 1,
        }
    ),
}
LIGHT = {
    name: brightness_at(OpeningMeter.of(GENERIC, REST).measure(shape), SHADING)
    for name, shape in SHAPES.items()
}


def texels(part: str) -> Array:
    return part_mask(SURFACE, GENERIC.mesh, part)


def truth(name: str) -> Array:
    """(H, W, 3) what this person's texture is in that expression: colours by part, shaded."""
    image = np.full((SIDE, SIDE, 3), SKIN, float)
    for part, column in PARTS.items():
        colour = np.array(EYES if "eye" in part else TEETH)
        image[texels(part)] = colour * LIGHT[name][column]
    return np.rint(np.clip(image, 0, 255)).astype(np.uint8)


def photo(name: str, exposure: float = 1.0) -> Array:
    """The person before a plain wall."""
    camera = close_up()
    mesh = GENERIC.mesh.with_vertices(SHAPES[name])
    image = render(mesh, camera, truth(name), samples=4, background=(40, 60, 40))[..., :3]
    return np.rint(exposure * image).astype(np.uint8)


def close_up() -> Camera:
    """Twice as near as the whole head needs: slits between lips are several pixels wide."""
    far = at(0.0)
    return Camera(2 * far.width, 2 * far.height, 2 * far.focal_px, far.R_cam_head, far.t_cam_head)


def base() -> Array:
    """Neutral's texture so far: eyes and teeth have a grey that is not theirs."""
    image = truth("neutral")
    for part in PARTS:
        image[texels(part)] = 100
    return image


@cache
def looks(exposure: float = 1.0) -> ExpressionTextures:
    """What comes of one photo of each, the last of another exposure."""
    camera = close_up()
    shown = {
        name: ExpressionPhotos(shape, [camera], [photo(name)]) for name, shape in SHAPES.items()
    }
    darker = photo("awe", exposure)
    shown["awe"] = ExpressionPhotos(SHAPES["awe"], [camera], [darker])
    return extract_expression_textures(GENERIC.mesh, shown, base(), GENERIC)


def off(name: str, where: Array) -> Array:
    """(N,) how far the texels of this expression's texture are from the truth."""
    difference = looks().textures[name][where].astype(float) - truth(name)[where]
    return np.abs(difference).max(axis=1)


def rightly_shown(name: str, part: str) -> Array:
    """(H, W) where the expression's own texture has the part's true colour."""
    where = texels(part)
    where[where] = off(name, where) <= 6
    return where


@pytest.mark.parametrize("part", ["left_eyeball", "right_eyeball"])
def test_eyes_only_in_neutral_are_used_for_closed_eyes(part: str) -> None:
    """As dark as they are behind closing lids."""
    shown = rightly_shown("neutral", part)
    assert shown.sum() > 100
    assert np.median(off("asleep", shown)) <= 2
    assert np.mean(off("asleep", shown) <= 10) > 0.6
    assert truth("asleep")[shown].mean() < 0.75 * truth("neutral")[shown].mean()


@pytest.mark.parametrize("part", ["upper_teeth", "lower_teeth"])
@pytest.mark.parametrize("other", ["neutral", "asleep"])
def test_teeth_only_in_an_open_mouth_are_used_for_the_others(part: str, other: str) -> None:
    """As dark as they are behind lips that hardly part."""
    shown = rightly_shown("awe", part)
    assert shown.sum() > 100
    assert np.median(off(other, shown)) <= 2
    assert np.percentile(off(other, shown), 90) <= 10
    assert truth(other)[shown].mean() < 0.75 * truth("awe")[shown].mean()


@pytest.mark.parametrize("name", list(SHAPES))
def test_skin_is_that_of_the_photos(name: str) -> None:
    assert np.percentile(off(name, texels("skin")), 99) <= 3


def test_without_two_photos_of_one_part_shading_is_the_default() -> None:
    """Only one of these shows teeth, and eyes at rest are as open as eyes in awe."""
    for part, polynomial in looks().shading.items():
        np.testing.assert_allclose(polynomial, SHADING[part], atol=0.02)


def test_exposures_are_matched_to_neutrals() -> None:
    result = looks(0.8)
    np.testing.assert_allclose(result.gains["neutral"], 1, atol=0.02)
    np.testing.assert_allclose(result.gains["awe"], 1 / 0.8, atol=0.02)
    where = texels("skin")
    difference = result.textures["awe"][where].astype(float) - SKIN
    assert np.percentile(np.abs(difference), 99) <= 4


def test_the_same_photos_give_the_same_textures() -> None:
    again = looks.__wrapped__()
    for name, pixels in looks().textures.items():
        assert again.textures[name].tobytes() == pixels.tobytes()
