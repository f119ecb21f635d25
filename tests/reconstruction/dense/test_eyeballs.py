from __future__ import annotations

import numpy as np

from marbled import GENERIC
from mien.reconstruction.dense.eyeballs import fit_eyeballs

VERTICES = GENERIC.mesh.vertices
BALL = GENERIC.mesh.vertices_of("left_eyeball")
SKIN = GENERIC.mesh.vertices_of("skin")


def inside_mm(vertices: np.ndarray) -> float:
    """How deep the deepest skin before the ball's centre lies inside the ball."""
    centre = vertices[BALL].mean(axis=0)
    radius = np.linalg.norm(vertices[BALL] - centre, axis=1).max()
    near = SKIN[VERTICES[SKIN, 2] > centre[2] + 5]
    return float(radius - np.linalg.norm(vertices[near] - centre, axis=1).min())


def test_a_head_whose_eyes_sit_well_is_hardly_changed() -> None:
    seated = fit_eyeballs(VERTICES, GENERIC)
    assert np.abs(seated[BALL] - VERTICES[BALL]).max() < 0.5


def test_a_ball_that_stands_out_goes_back() -> None:
    out = VERTICES.copy()
    out[BALL] += [0.5, 0.0, 2.5]
    seated = fit_eyeballs(out, GENERIC)
    away = np.linalg.norm((seated - VERTICES)[BALL].mean(axis=0))
    assert away < 0.5 * np.linalg.norm([0.5, 0.0, 2.5])
    assert inside_mm(seated) < max(inside_mm(VERTICES), 0.1) + 0.3
    # As a whole: it stays as round as it was, whatever its size.
    shape, before = (
        vertices[BALL] - vertices[BALL].mean(axis=0) for vertices in (seated, VERTICES)
    )
    scale = np.linalg.norm(shape) / np.linalg.norm(before)
    np.testing.assert_allclose(shape, scale * before, atol=1e-9)


def test_lids_farther_apart_have_a_larger_ball_between_them() -> None:
    centre = VERTICES[BALL].mean(axis=0)
    wide = VERTICES.copy()
    near = SKIN[np.linalg.norm(VERTICES[SKIN] - centre, axis=1) < 25]
    wide[near] = centre + 1.1 * (VERTICES[near] - centre)
    seated = fit_eyeballs(wide, GENERIC)
    grown = np.linalg.norm(seated[BALL] - seated[BALL].mean(axis=0)) / np.linalg.norm(
        VERTICES[BALL] - centre
    )
    assert 1.01 < grown < 1.12


def test_lids_that_sink_in_are_lifted_out() -> None:
    sunk = VERTICES.copy()
    centre = VERTICES[BALL].mean(axis=0)
    gap = np.linalg.norm(VERTICES - centre, axis=1)
    lids = SKIN[(gap[SKIN] < 20) & (VERTICES[SKIN, 2] > centre[2] + 5)]
    sunk[lids[::3], 2] -= 1.5
    assert inside_mm(fit_eyeballs(sunk, GENERIC)) < inside_mm(sunk)
