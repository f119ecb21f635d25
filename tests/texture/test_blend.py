from __future__ import annotations

import numpy as np
import pytest

from mien.texture.atlas import atlas_surface
from mien.texture.blend import blend_views
from mien.texture.visibility import prepare_view, surface_visibility
from shapes import camera_at, ellipsoid


@pytest.mark.parametrize("power", [1.0, 3.0])
def test_colours_are_the_convex_combination_by_visibility_times_certainty(power: float) -> None:
    mesh = ellipsoid()
    surface = atlas_surface(mesh, width=80, height=60)
    tones = np.array([[200.0, 100, 50], [40, 160, 240], [90, 90, 90]])
    photos = [np.full((320, 320, 3), tone, np.uint8) for tone in tones]
    yaws = (-40, 0, 60)
    views = [
        prepare_view(mesh, camera_at(yaw, mesh), photo)
        for yaw, photo in zip(yaws, photos, strict=True)
    ]
    gains = np.array([[1, 1, 1], [1.1, 1, 0.9], [1, 1, 1]])
    blend = blend_views(surface, views, gains, feather_mm=20, certainty_power=power)
    seen = [surface_visibility(surface, view, feather_mm=20) for view in views]
    weights = np.stack([s.feathered * s.certainty**power for s in seen])  # g_k = F_k P_k
    np.testing.assert_allclose(blend.coverage, weights.sum(axis=0), rtol=1e-4, atol=1e-6)
    lit = blend.coverage > 1e-3
    shares = weights[:, lit] / weights[:, lit].sum(axis=0)
    np.testing.assert_allclose(shares.sum(axis=0), 1, rtol=1e-5)
    expected = np.einsum("kn,kc->nc", shares, tones * gains)
    np.testing.assert_allclose(blend.colours[lit], expected, rtol=1e-3)
    assert not blend.colours[blend.coverage == 0].any()


def test_grazing_views_have_low_confidence() -> None:
    mesh = ellipsoid()
    surface = atlas_surface(mesh, width=80, height=60)
    view = prepare_view(mesh, camera_at(0, mesh), np.full((320, 320, 3), 99, np.uint8))
    blend = blend_views(surface, [view], feather_mm=0.1, certainty_power=1)
    certainty = surface_visibility(surface, view, feather_mm=0.1).certainty
    assert not blend.confidence[certainty < 0.17].any()
    np.testing.assert_allclose(blend.confidence[certainty > 0.4], 1)
    # Where the outline's margin and the ramp of the visibility leave it alone.
    between = (certainty > 0.29) & (certainty < 0.33) & (blend.coverage > 0.99 * certainty)
    assert between.sum() > 20
    np.testing.assert_allclose(
        blend.confidence[between], (certainty[between] - 0.17) / 0.17, atol=1e-5
    )


@pytest.mark.parametrize("fade", [(0.2, 0.5), (0.3, 0.6)])
def test_colours_fade_out_between_the_two_cosines(fade: tuple[float, float]) -> None:
    mesh = ellipsoid()
    surface = atlas_surface(mesh, width=80, height=60)
    photo = np.full((320, 320, 3), 99, np.uint8)
    view = prepare_view(mesh, camera_at(0, mesh), photo, outline_mm=0)
    blend = blend_views(surface, [view], feather_mm=0.1, fade=fade)
    seen = surface_visibility(surface, view, feather_mm=0.1, min_certainty=fade[0])
    whole = seen.feathered > 0.99
    expected = np.clip((seen.certainty - fade[0]) / (fade[1] - fade[0]), 0, 1)
    np.testing.assert_allclose(blend.confidence[whole], expected[whole], atol=1e-5)
    assert not blend.confidence[seen.certainty < fade[0]].any()
    assert (blend.confidence[whole] == 1).any()
    assert ((blend.confidence > 0) & (blend.confidence < 1)).any()
