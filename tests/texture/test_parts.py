from __future__ import annotations

import numpy as np

from mien.texture.blend import Blend
from mien.texture.parts import STYLES, fill_colour


def eye(colours: list[tuple[int, int, int]], shares: list[int]) -> Blend:
    texels = np.repeat(np.float32(colours), shares, axis=0)[None]
    ones = np.ones(texels.shape[:2], np.float32)
    return Blend(texels, ones, ones)


def test_the_white_of_an_eye_is_bright_and_grey() -> None:
    iris, white, lid, glint = (70, 50, 40), (170, 165, 160), (160, 110, 95), (250, 250, 250)
    tone = fill_colour(STYLES["left_eyeball"], eye([iris, white, lid, glint], [300, 500, 150, 30]))
    np.testing.assert_allclose(tone, white, atol=8)


def test_without_enough_of_it_the_default_is_taken() -> None:
    tone = fill_colour(STYLES["left_eyeball"], eye([(170, 165, 160)], [10]))
    np.testing.assert_array_equal(tone, STYLES["left_eyeball"].default)


def test_other_parts_have_their_own_colours() -> None:
    seen = eye([(10, 200, 10)], [500])
    for name in ("upper_teeth", "tongue", "lashes"):
        np.testing.assert_array_equal(fill_colour(STYLES[name], seen), STYLES[name].default)
