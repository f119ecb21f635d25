"""Normal equations: the analytic Jacobian beside central differences, pixel sums, weights."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

import patterned
from mien.arrays import Array
from mien.track.image.drawing import Drawing
from mien.track.parameters import Parameters
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS, image_jacobian, vertex_jacobian
from mien.track.photometric.linearization import (
    PyramidLevel,
    linearize_pose,
    linearize_pose_and_face,
)
from mien.track.photometric.normal_equations import NormalEquations
from mien.track.photometric.numeric_jacobian import numeric_linearizer

FACE = patterned.doing(
    {"mouth": (0.4, 0.1), "eyes": (0.0, 0.5), "forehead": (0.2, 0.3)}, units=(0.2, 0.1)
)
START = Parameters(patterned.pose(), FACE)
COUNT = POSE_UNKNOWNS + len(FACE.vector)
ALL, NONE = np.ones(COUNT, bool), np.zeros(COUNT, bool)
BLINKS = np.s_[POSE_UNKNOWNS + 6 : POSE_UNKNOWNS + 8]
GAZE = np.s_[POSE_UNKNOWNS + 8 :]
TELLING = np.r_[: POSE_UNKNOWNS + 6]
"""Unknowns that move or mix more of this face than a lid."""


@pytest.fixture(scope="module")
def level() -> PyramidLevel:
    """A picture that differs by what is no motion, away from lids, lips and the outline."""
    own = patterned.level(START)
    away = own.draw(START, layers=False)
    rows, columns = np.indices(own.target.shape)
    # So slow that its gradient is next to none.
    error = 8 + 6 * np.sin(rows / 40) * np.cos(columns / 50)
    return replace(own, target=np.float32(own.target + error), weights=np.float32(whole(away)))


def whole(drawing: Drawing) -> Array:
    """Where nothing near hides something else."""
    mesh, shown = patterned.GENERIC.mesh, patterned.model().painted.triangles
    part = np.zeros(len(mesh.vertices), int)
    for number, name in enumerate(mesh.part_names):
        part[mesh.triangles[mesh.triangles_of(name)]] = number
    parts = np.where(drawing.ids >= 0, part[shown[drawing.ids, 0]], -1)
    depth = np.where(drawing.ids >= 0, drawing.depth, 2000.0)
    flat = maximum_filter(depth, 5) - minimum_filter(depth, 5) < 12
    return flat & (maximum_filter(parts, 5) == minimum_filter(parts, 5))


def both(
    level: PyramidLevel, *, plain: bool, exact: bool = False
) -> tuple[NormalEquations, NormalEquations]:
    ways = (numeric_linearizer(which, plain=plain, exact=exact) for which in (NONE, ALL))
    analytic, numeric = (way(level, START).normal_equations(START) for way in ways)
    return analytic, numeric


def assert_alike(
    one: NormalEquations, other: NormalEquations, which: Array, tolerance: float
) -> None:
    """J^T J over the lengths of J's columns; J^T r over them and the residual's."""
    lengths = np.sqrt(np.diag(other.matrix))[which]
    assert lengths.min() > 0
    gap = (one.matrix - other.matrix)[np.ix_(which, which)] / np.outer(lengths, lengths)
    assert np.abs(gap).max() < tolerance
    gap = (one.vector - other.vector)[which] / lengths / np.sqrt(other.squares)
    assert np.abs(gap).max() < tolerance / 3
    assert one.squares == pytest.approx(other.squares)
    assert one.weight == pytest.approx(other.weight)


def test_plain_pictures(level: PyramidLevel) -> None:
    """Sobel's smoothing makes gradients of this pattern some 3 % short, more on slopes."""
    assert_alike(*both(level, plain=True), TELLING, 0.15)


def test_band_pass_filtered_pictures(level: PyramidLevel) -> None:
    """Within a filter's width the picture flows at different speeds, most in depth and zoom."""
    assert_alike(*both(level, plain=False), np.delete(TELLING, [5, 6]), 0.28)


def test_the_rigs_own_face(level: PyramidLevel) -> None:
    assert_alike(*both(level, plain=True, exact=True), TELLING, 0.15)


def test_blinks(level: PyramidLevel) -> None:
    """Few pixels, most of them between a lid and an eye: alike, no more."""
    everywhere = replace(level, weights=level.crop.valid)
    analytic, numeric = both(everywhere, plain=False)
    own, true = np.diag(analytic.matrix)[BLINKS], np.diag(numeric.matrix)[BLINKS]
    assert ((own > 0.1 * true) & (own < 2 * true)).all()


def test_of_the_pose_alone_as_with_the_face(level: PyramidLevel) -> None:
    """The same seven columns."""
    alone = linearize_pose(level, START).normal_equations(START)
    together = numeric_linearizer(NONE, plain=True)(level, START).normal_equations(START)
    assert_alike(alone, together, np.arange(POSE_UNKNOWNS), 1e-3)
    assert not alone.matrix[POSE_UNKNOWNS:].any()
    assert not alone.vector[POSE_UNKNOWNS:].any()


def test_bands_are_the_analytic_way(level: PyramidLevel) -> None:
    usual = linearize_pose_and_face(level, START).normal_equations(START)
    same = numeric_linearizer(NONE)(level, START).normal_equations(START)
    np.testing.assert_allclose(usual.matrix, same.matrix, rtol=1e-4, atol=1e-4 * usual.matrix.max())
    np.testing.assert_allclose(usual.vector, same.vector, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("unknown", [0, 1, 2, 3, 4, 5, 6, 7, 10, 11])
def test_downhill_leads_back(level: PyramidLevel, unknown: int) -> None:
    """From either side of the truth: the sign of every unknown, and about how far."""
    step = np.zeros(COUNT)
    step[unknown] = (0.01, 0.01, 0.01, 1, 1, 6, 0.01, *[0.1] * 6)[unknown]
    level = replace(level, target=level.draw(START, layers=False).luma)
    ways = {linearize_pose_and_face: 0.3} | (
        {linearize_pose: 0.05} if unknown < POSE_UNKNOWNS else {}
    )
    for linearized, tolerance in ways.items():
        for moved in (step, -step):
            start = START.plus(moved)
            found = linearized(level, start).normal_equations(start)
            back = found.vector[unknown] / found.matrix[unknown, unknown]
            assert back == pytest.approx(-moved[unknown], rel=tolerance)


def test_flows_are_those_of_the_projection(rng: np.random.Generator) -> None:
    """[Pighin 2002] app. B: against differences of projected vertices."""
    model = patterned.model()
    level = patterned.level(START)
    drawing = level.draw(START, layers=False)
    jacobian = image_jacobian(model.offsets, drawing.positions, START.pose, level.crop)
    jacobian = vertex_jacobian(jacobian, drawing.positions)
    chosen = rng.integers(0, len(drawing.positions), 50)

    def projected(parameters: Parameters) -> Array:
        face = model.posed(level.anchor, parameters.face)
        positions = face.vertices[chosen] @ parameters.pose.R.T + parameters.pose.t
        return level.crop.focal * parameters.pose.zoom * positions[:, :2] / positions[:, 2:]

    for unknown, step in enumerate(1e-4 * np.eye(COUNT)):
        change = (projected(START.plus(step)) - projected(START.plus(-step))) / 2e-4
        np.testing.assert_allclose(jacobian[chosen, unknown], change, rtol=1e-3, atol=2e-3)


def test_robust_weights() -> None:
    """Geman and McClure's: a pixel that is off by the scale counts a quarter."""
    level = patterned.level(START)
    level = replace(level, target=level.target + np.float32(20))

    def sums(scale: float) -> NormalEquations:
        return linearize_pose(replace(level, scale=scale), START).normal_equations(START)

    all_count, quarter = sums(1e6), sums(20.0)
    assert quarter.weight == all_count.weight
    assert all_count.squares == pytest.approx(400 * all_count.weight, rel=1e-4)
    assert quarter.squares == pytest.approx(all_count.squares / 2, rel=1e-4)
    np.testing.assert_allclose(quarter.matrix, all_count.matrix / 4, rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(quarter.vector, all_count.vector / 4, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("linearized", [linearize_pose_and_face, linearize_pose])
def test_any_number_of_threads_gives_the_same_bits(level: PyramidLevel, linearized) -> None:
    found = []
    usual = numba.get_num_threads()
    for threads in (1, min(2, usual)):
        numba.set_num_threads(threads)
        found.append(linearized(level, START).normal_equations(START))
    numba.set_num_threads(usual)
    np.testing.assert_array_equal(found[0].matrix, found[1].matrix)
    np.testing.assert_array_equal(found[0].vector, found[1].vector)
    assert found[0].squares == found[1].squares
