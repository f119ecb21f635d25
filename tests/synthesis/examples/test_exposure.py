"""Gains between photos that are known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.synthesis.examples.example_set import Example
from mien.synthesis.examples.exposure import apply_gain, equalize_exposure, exposure_gains

GAIN = np.array([0.9, 1.0, 1.2])


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


@pytest.fixture
def face(layout, rng):
    """A smooth pattern with noise, of middling brightness."""
    positions = np.mgrid[:160, :140].sum(axis=0)[..., None] / 25
    photo = 110 + 40 * np.sin(positions + np.arange(3)) + rng.normal(size=(160, 140, 3))
    return Example("rest", photo.round().astype(np.uint8), 70 + 80 * layout.template, "a")


def test_gains_are_those_that_the_photos_were_made_with(layout, face):
    darker = replace(face, name="b", photo=apply_gain(face.photo, 1 / GAIN))
    np.testing.assert_allclose(exposure_gains(layout, [face, darker]), [[1, 1, 1], GAIN], atol=0.01)


def test_an_expression_and_a_moved_head_are_no_exposure(layout, face):
    """A tenth of the face differs, and the photo is cut differently."""
    photo = np.roll(apply_gain(face.photo, 1 / GAIN), (7, -5), axis=(0, 1))
    chin = np.rint(face.points[layout.index("chin")]).astype(int)
    photo[chin[1] - 12 : chin[1] + 12, chin[0] - 12 : chin[0] + 12] = 20
    moved = Example("b", photo, face.points + np.array([-5, 7]), "b")
    np.testing.assert_allclose(exposure_gains(layout, [face, moved])[1], GAIN, atol=0.02)


def test_white_and_black_are_not_compared(layout, face):
    photo = apply_gain(face.photo, np.full(3, 1.7))
    assert (photo == 255).any()
    clipped = Example("b", photo, face.points, "b")
    np.testing.assert_allclose(exposure_gains(layout, [face, clipped])[1], 1 / 1.7, atol=0.01)
    black = Example("c", np.zeros_like(photo), face.points, "c")
    np.testing.assert_array_equal(exposure_gains(layout, [face, black])[1], 1)


def test_other_exposures_are_equalized_and_noise_is_ignored(layout, face):
    darker = replace(face, name="b", photo=apply_gain(face.photo, 1 / GAIN))
    alike = replace(face, name="c", photo=apply_gain(face.photo, np.full(3, 1.02)))
    found = equalize_exposure(layout, (face, darker, alike))
    assert np.abs(found[1].photo.astype(int) - face.photo).max() <= 2
    assert found[0] is face
    assert found[2] is alike
