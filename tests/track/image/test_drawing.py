"""The face drawn for comparison: [Pighin 2002] eq. (5), and the same picture as everywhere else."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy.ndimage import binary_erosion

import patterned
from mien.arrays import Array
from mien.track.image.drawing import Drawing, draw, draw_colours
from mien.track.image.frame_pyramid import FrameCrop
from mien.track.image.greyscale import LUMA
from mien.track.parameters import Parameters

MIXED = patterned.doing({"mouth": (0.6, 0.2), "eyes": (0.0, 0.7), "forehead": (-0.2, 1.1)})


@pytest.fixture
def seen() -> tuple[Parameters, FrameCrop]:
    parameters = Parameters(patterned.pose(), MIXED)
    return parameters, patterned.crop(patterned.picture(parameters), parameters.pose)


def drawn(parameters: Parameters, crop: FrameCrop, *, layers: bool = True) -> Drawing:
    model = patterned.model()
    face = model.anchored(parameters.face).face
    return draw(
        model.painted, model.grey, model.compared, face, parameters.pose, crop, layers=layers
    )


def test_mixture_is_the_sum_of_the_layers_by_their_weights(
    seen: tuple[Parameters, FrameCrop],
) -> None:
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


def test_layers_are_the_expressions_pictures_on_one_geometry(
    seen: tuple[Parameters, FrameCrop],
) -> None:
    parameters, crop = seen
    model = patterned.model()
    face = model.anchored(parameters.face).face
    found = drawn(parameters, crop)
    for number in range(found.layers.shape[2]):
        weights = np.zeros_like(face.weights)
        weights[:, number] = 1
        alone = type(face)(face.vertices, weights, face.brightness)
        single = draw(
            model.painted, model.grey, model.compared, alone, parameters.pose, crop, layers=False
        )
        np.testing.assert_allclose(single.luma, found.layers[..., number], atol=0.02)
        assert single.layers.shape[2] == 0


def test_the_same_as_the_renderers_picture(seen: tuple[Parameters, FrameCrop]) -> None:
    parameters, crop = seen
    found = drawn(parameters, crop, layers=False)
    usual = crop.pixels @ np.array(LUMA)
    inner = binary_erosion(found.mask > 0, iterations=3)
    off = np.abs(found.luma - usual)[inner]
    # Nine samples a pixel differ from one where lids and lips are.
    assert np.median(off) < 1
    assert np.quantile(off, 0.97) < 2.5


def test_places_and_depth(seen: tuple[Parameters, FrameCrop]) -> None:
    parameters, crop = seen
    found = drawn(parameters, crop)
    face = patterned.model().anchored(MIXED).face
    np.testing.assert_allclose(
        found.positions, patterned.camera(parameters.pose).to_camera(face.vertices)
    )
    inside = found.ids >= 0
    corners = found.positions[patterned.model().painted.triangles[found.ids[inside]]]
    positions = np.einsum("mc,mcd->md", found.barycentrics[inside], corners)
    np.testing.assert_allclose(found.depth[inside], positions[:, 2], rtol=1e-5)
    rows, columns = np.nonzero(inside)
    pixels = crop.focal * positions[:, :2] / positions[:, 2:] + (crop.cx, crop.cy)
    np.testing.assert_allclose(pixels, np.column_stack([columns, rows]) + 0.5, atol=2e-3)


def test_zoom_is_a_longer_lens(seen: tuple[Parameters, FrameCrop]) -> None:
    parameters, crop = seen
    pose, longer = (
        parameters.pose,
        FrameCrop(crop.pixels, crop.valid, 1.1 * crop.focal, crop.cx, crop.cy),
    )
    zoomed = drawn(Parameters(type(pose)(pose.R, pose.t, 1.1), MIXED), crop)
    np.testing.assert_allclose(zoomed.luma, drawn(parameters, longer).luma, atol=0.05)


def test_in_colour(seen: tuple[Parameters, FrameCrop]) -> None:
    parameters, crop = seen
    model = patterned.model()
    face = model.anchored(parameters.face).face
    colours, shown = draw_colours(model.painted, model.compared, face, parameters.pose, crop)
    found = drawn(parameters, crop)
    np.testing.assert_array_equal(shown, found.mask)
    # The greys are kept in whole levels.
    np.testing.assert_allclose(colours @ np.array(LUMA), found.luma, atol=0.6)


def test_any_number_of_threads_draws_the_same(seen: tuple[Parameters, FrameCrop]) -> None:
    image_pair: list[Array] = []
    usual = numba.get_num_threads()
    for threads in (1, min(2, usual)):
        numba.set_num_threads(threads)
        image_pair.append(drawn(*seen).layers)
    numba.set_num_threads(usual)
    np.testing.assert_array_equal(*image_pair)
