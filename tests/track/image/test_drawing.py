"""The face drawn for comparison: [Pighin 2002] eq. (5), and the same picture as everywhere else."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy.ndimage import binary_erosion

import patterned
from mien.arrays import Array
from mien.track.image.drawing import Drawing, draw, draw_colours
from mien.track.image.frame_pyramid import View
from mien.track.image.greyscale import LUMA
from mien.track.parameters import Guess

MIXED = patterned.doing({"mouth": (0.6, 0.2), "eyes": (0.0, 0.7), "forehead": (-0.2, 1.1)})


@pytest.fixture
def seen() -> tuple[Guess, View]:
    guess = Guess(patterned.pose(), MIXED)
    return guess, patterned.view(patterned.picture(guess), guess.pose)


def drawn(guess: Guess, view: View, *, layers: bool = True) -> Drawing:
    model = patterned.model()
    face = model.anchored(guess.face).face
    return draw(model.painted, model.grey, model.compared, face, guess.pose, view, layers=layers)


def test_mixture_is_the_sum_of_the_layers_by_their_weights(seen: tuple[Guess, View]) -> None:
    found, model = drawn(*seen), patterned.model()
    inside = found.ids >= 0
    corners = model.painted.triangles[found.ids[inside]]
    weights = model.anchored(MIXED).face.weights[corners]
    weights = np.einsum("mc,mck->mk", found.barycentrics[inside], weights)
    mixed = (weights * found.layers[inside]).sum(axis=1)
    np.testing.assert_allclose(found.luma[inside], mixed, atol=0.02)
    np.testing.assert_array_equal(found.mask, inside)
    assert not found.luma[~inside].any()
    assert not found.layers[~inside].any()


def test_layers_are_the_expressions_pictures_on_one_geometry(seen: tuple[Guess, View]) -> None:
    guess, view = seen
    model = patterned.model()
    face = model.anchored(guess.face).face
    found = drawn(guess, view)
    for number in range(found.layers.shape[2]):
        weights = np.zeros_like(face.weights)
        weights[:, number] = 1
        alone = type(face)(face.vertices, weights, face.brightness)
        single = draw(
            model.painted, model.grey, model.compared, alone, guess.pose, view, layers=False
        )
        np.testing.assert_allclose(single.luma, found.layers[..., number], atol=0.02)
        assert single.layers.shape[2] == 0


def test_the_same_as_the_renderers_picture(seen: tuple[Guess, View]) -> None:
    guess, view = seen
    found = drawn(guess, view, layers=False)
    usual = view.pixels @ np.array(LUMA)
    inner = binary_erosion(found.mask > 0, iterations=3)
    off = np.abs(found.luma - usual)[inner]
    # Nine samples a pixel differ from one where lids and lips are.
    assert np.median(off) < 1
    assert np.quantile(off, 0.97) < 2.5


def test_places_and_depth(seen: tuple[Guess, View]) -> None:
    guess, view = seen
    found = drawn(guess, view)
    face = patterned.model().anchored(MIXED).face
    np.testing.assert_allclose(found.places, patterned.camera(guess.pose).to_camera(face.vertices))
    inside = found.ids >= 0
    corners = found.places[patterned.model().painted.triangles[found.ids[inside]]]
    places = np.einsum("mc,mcd->md", found.barycentrics[inside], corners)
    np.testing.assert_allclose(found.depth[inside], places[:, 2], rtol=1e-5)
    rows, columns = np.nonzero(inside)
    pixels = view.focal * places[:, :2] / places[:, 2:] + (view.cx, view.cy)
    np.testing.assert_allclose(pixels, np.column_stack([columns, rows]) + 0.5, atol=2e-3)


def test_zoom_is_a_longer_lens(seen: tuple[Guess, View]) -> None:
    guess, view = seen
    pose, longer = guess.pose, View(view.pixels, view.inside, 1.1 * view.focal, view.cx, view.cy)
    zoomed = drawn(Guess(type(pose)(pose.R, pose.t, 1.1), MIXED), view)
    np.testing.assert_allclose(zoomed.luma, drawn(guess, longer).luma, atol=0.05)


def test_in_colour(seen: tuple[Guess, View]) -> None:
    guess, view = seen
    model = patterned.model()
    face = model.anchored(guess.face).face
    colours, shown = draw_colours(model.painted, model.compared, face, guess.pose, view)
    found = drawn(guess, view)
    np.testing.assert_array_equal(shown, found.mask)
    # The greys are kept in whole levels.
    np.testing.assert_allclose(colours @ np.array(LUMA), found.luma, atol=0.6)


def test_any_number_of_threads_draws_the_same(seen: tuple[Guess, View]) -> None:
    pictures: list[Array] = []
    usual = numba.get_num_threads()
    for threads in (1, min(2, usual)):
        numba.set_num_threads(threads)
        pictures.append(drawn(*seen).layers)
    numba.set_num_threads(usual)
    np.testing.assert_array_equal(*pictures)
