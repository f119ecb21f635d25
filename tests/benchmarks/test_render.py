from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.render import difference
from benchmarks.render_gl import PassRenderer, is_installed
from benchmarks.render_scene import build_scene

from mien.render.morph import MorphRenderer


def test_weights_sum_to_one_and_leave_the_rest_alone() -> None:
    scene = build_scene(60, 80, 3, texels=64)
    for face in scene.faces[::7]:
        np.testing.assert_allclose(face.weights.sum(axis=1), 1)
        alone = (face.weights == [1, 0, 0]).all(axis=1)
        assert 0.1 < alone.mean() < 0.9
        assert face.weights.min() >= -0.5
        assert face.weights.max() <= 1.5


def test_pictures_are_compared_where_both_are_opaque(tmp_path: Path) -> None:
    first = np.full((10, 10, 4), 255, np.uint8)
    second = first.copy()
    second[0, 0] = (250, 255, 255, 255)
    second[1, 1] = (0, 0, 0, 254)
    np.save(tmp_path / "a.npy", first)
    np.save(tmp_path / "b.npy", second)
    mean, _, greatest = difference(tmp_path / "a.npy", tmp_path / "b.npy")
    assert greatest == 5
    assert mean == pytest.approx(5 / (99 * 3))


@pytest.mark.skipif(not is_installed(), reason="moderngl is not installed")
def test_passes_show_the_same_picture() -> None:
    scene = build_scene(120, 160, 3, texels=256)
    try:
        peer = PassRenderer(scene)
    except Exception as error:  # moderngl raises bare exceptions without an OpenGL
        pytest.skip(f"no OpenGL without a window: {error}")
    ours = MorphRenderer(scene.mesh, scene.textures).render(scene.faces[9], scene.camera)
    theirs = peer.render(scene.faces[9])
    whole = (ours[..., 3] == 255) & (theirs[..., 3] == 255)
    off = np.abs(ours.astype(int) - theirs)[whole]
    assert whole.mean() > 0.2
    assert off.mean() < 1.5
    assert np.percentile(off, 99) < 8
    assert ours[..., 3].mean() == pytest.approx(theirs[..., 3].mean(), rel=0.01)
