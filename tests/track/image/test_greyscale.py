from __future__ import annotations

import numpy as np

from mien.arrays import Array
from mien.render.mipmap import build_pyramids
from mien.track.image.greyscale import LUMA, STEPS, grey_pyramids

RNG = np.random.default_rng(7)


def textures(side: int) -> list[Array]:
    return [RNG.integers(0, 256, (side, side, 3), np.uint8) for _ in range(3)]


def test_luma_of_every_texture_side_by_side() -> None:
    image_pair = textures(64)
    grey = grey_pyramids(build_pyramids(image_pair))
    assert grey.dropped == 0
    finest = grey.texels[: 64 * 64].reshape(64, 64, 3) / STEPS
    expected = np.stack([picture @ np.array(LUMA) for picture in image_pair], axis=2)
    np.testing.assert_allclose(finest, expected, atol=0.6 / STEPS)


def test_levels_finer_than_faces_are_drawn_are_left_out() -> None:
    pyramids = build_pyramids(textures(2048)[:1])
    grey = grey_pyramids(pyramids)
    assert grey.dropped == 1
    assert grey.widths[0] == grey.heights[0] == 1024
    np.testing.assert_array_equal(grey.widths, pyramids.widths[1:])
    assert grey.starts[0] == 0
    assert len(grey.texels) == pyramids.texels.shape[1] - 2048**2
