"""Skin that has moved as is known, seen by exact cameras."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from expressive import FACE, NEUTRAL, SKIN, bump, making, skin_seen, vertices_seen, weights_of
from marbled import GENERIC, at
from mien.arrays import Array
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.observations import SurfaceObservations
from mien.reconstruction.shape.skin import BENDING, REACH_MM, _stiffness, deform_skin

CAMERAS = [at(-20, 4), at(20, -4)]
NOWHERE = np.zeros(len(NEUTRAL))
MESH = GENERIC.mesh.with_vertices(NEUTRAL)
UPPER, LOWER = (
    np.array(
        [v for kind in ("outer", "inner") for v in GENERIC.polylines[f"{lip}_lip_{kind}"][2:-2]]
    )
    for lip in ("upper", "lower")
)


def place(name: str) -> Array:
    return np.array(GENERIC.mesh.vertices[GENERIC.vertex_of(name)])


@pytest.fixture(scope="module")
def moved() -> Array:
    """A corner of the mouth, an eye's and the chin are elsewhere."""
    moves = [
        bump(place("left_mouth_corner"), width_mm=20, along=(3, 2, 1)),
        bump(place("right_eye_outer"), width_mm=20, along=(-1, 2, 0)),
        bump(place("chin"), width_mm=20, along=(0, -2, 2)),
    ]
    return NEUTRAL + np.sum(moves, axis=0)


@pytest.fixture(scope="module")
def seen(moved: Array) -> SurfaceObservations:
    return skin_seen(moved, CAMERAS, count=1200)


@pytest.fixture(scope="module")
def found(seen: SurfaceObservations) -> Array:
    return deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE)


def test_skin_goes_where_two_photos_show_it(
    moved: Array, seen: SurfaceObservations, found: Array
) -> None:
    assert np.linalg.norm(seen.on(moved) - seen.on(NEUTRAL), axis=1).max() > 3
    off = np.linalg.norm(seen.on(found) - seen.on(moved), axis=1)
    assert np.median(off) < 0.02
    assert np.percentile(off, 95) < 0.2
    between = np.linalg.norm(found - moved, axis=1)[FACE]
    assert np.median(between) < 0.02
    assert between.max() < 1


def test_only_skin_moves(found: Array) -> None:
    others = np.setdiff1d(np.arange(len(NEUTRAL)), SKIN)
    np.testing.assert_array_equal(found[others], NEUTRAL[others])


def test_what_is_seen_where_it_is_does_not_move() -> None:
    seen = skin_seen(NEUTRAL, CAMERAS, count=300)
    still = deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE)
    np.testing.assert_allclose(still, NEUTRAL, atol=1e-9)


def test_without_sightings_nothing_moves() -> None:
    seen = skin_seen(NEUTRAL, CAMERAS, count=3)
    nothing = SurfaceObservations(*(getattr(seen, field.name)[:0] for field in fields(seen)))
    still = deform_skin(NEUTRAL, nothing, CAMERAS, GENERIC, held=NOWHERE)
    np.testing.assert_allclose(still, NEUTRAL, atol=1e-9)


def cost(vertices: Array, seen: SurfaceObservations, across_sd_mm: float | None) -> float:
    """What deform_skin says it minimizes: the distances written out, the bending its own."""
    total = 0.0
    for k, item in enumerate(CAMERAS):
        mine = seen.photo == k
        off = item.project((seen.on(vertices) + seen.offset)[mine]) - seen.image_points[mine]
        sigma = seen.sigma_mm[mine] * item.focal_px / item.t_cam_head[2]
        total += loss_named("cauchy")((off**2).sum(axis=1) / sigma**2)[0].sum()
    moves = (vertices - NEUTRAL)[SKIN].ravel()
    return float(total + moves @ (_stiffness(MESH, SKIN, NOWHERE, across_sd_mm) @ moves))


@pytest.mark.parametrize("across_sd_mm", [None, 0.3])
def test_every_nudge_of_the_answer_costs(
    seen: SurfaceObservations, rng: np.random.Generator, across_sd_mm: float | None
) -> None:
    best = deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE, across_sd_mm=across_sd_mm)
    least = cost(best, seen, across_sd_mm)
    assert least < 0.5 * cost(NEUTRAL, seen, across_sd_mm)
    for width_mm in (10, 20, 40, 40):
        middle = GENERIC.mesh.vertices[rng.choice(FACE)]
        nudge = bump(middle, width_mm=width_mm, along=0.1 * rng.normal(size=3))
        assert cost(best + nudge, seen, across_sd_mm) > least
        assert cost(best - nudge, seen, across_sd_mm) > least


@pytest.mark.parametrize("width_mm", [20.0, 25.0])
def test_the_bending_is_that_of_a_thin_plate(width_mm: float) -> None:
    """Of exp(-r^2 / w^2) the squared Laplacian's integral is 4 pi / w^2, its own pi w^2 / 2."""
    middle = place("nose_root") + np.array([0, 45, 0])
    middle = GENERIC.mesh.vertices[
        SKIN[np.linalg.norm(GENERIC.mesh.vertices[SKIN] - middle, axis=1).argmin()]
    ]
    moves = bump(middle, width_mm=width_mm, along=(0, 0, 1))[SKIN].ravel()
    plate = 4 * np.pi / width_mm**2 + np.pi * width_mm**2 / 2 / REACH_MM**4
    energy = moves @ (_stiffness(GENERIC.mesh, SKIN, NOWHERE, None) @ moves)
    assert energy == pytest.approx(BENDING * plate, rel=0.1)


def test_held_skin_stays() -> None:
    regions = GENERIC.regions
    held = np.minimum(regions["scalp"] + regions["left_ear"] + regions["right_ear"], 1)
    lifted = NEUTRAL + np.array([0, 3, 0])
    seen = skin_seen(lifted, CAMERAS, count=600)
    moves, free = (
        np.linalg.norm(deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=mask) - NEUTRAL, axis=1)
        for mask in (held, NOWHERE)
    )
    still = SKIN[held[SKIN] > 0.99]
    assert moves[still].max() < 0.1
    assert free[still].max() > 2.5, "which goes along when it is free"
    assert np.median(moves[FACE]) == pytest.approx(3, abs=0.05)


def test_a_movement_fades_with_the_distance_from_what_is_seen() -> None:
    chin = GENERIC.points["chin"]
    seen = vertices_seen(NEUTRAL + np.array([0, 3, 0]), CAMERAS, np.array([chin]))
    found = deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE)
    moves = np.linalg.norm(found - NEUTRAL, axis=1)[SKIN]
    away = np.linalg.norm(NEUTRAL - NEUTRAL[chin], axis=1)[SKIN]
    assert moves[away < 10].min() > 2
    assert moves[away > 80].max() < 0.2
    assert moves.max() < 3.1


@pytest.mark.parametrize("across_sd_mm", [None, 0.3])
@pytest.mark.parametrize("along", [(0.0, 0.0, 2.0), (0.0, 2.0, 0.0)])
def test_measured_skin_moves_along_itself(
    along: tuple[float, float, float], across_sd_mm: float | None
) -> None:
    """On the forehead, which looks forward."""
    moves = bump(place("nose_root") + np.array([0, 35, 0]), width_mm=20, along=along)
    seen = skin_seen(NEUTRAL + moves, CAMERAS, count=900)
    found = deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE, across_sd_mm=across_sd_mm)
    there = FACE[np.linalg.norm(moves[FACE], axis=1) > 1]
    share = ((found - NEUTRAL)[there] @ along).sum() / (moves[there] @ along).sum()
    across = np.abs(((found - NEUTRAL) * MESH.vertex_normals()).sum(axis=1))
    if across_sd_mm is None or along[1]:
        assert share == pytest.approx(1, abs=0.1)
    else:
        assert share < 0.1
    if across_sd_mm is not None:
        assert across[FACE].max() < 0.1


def test_lips_of_an_open_mouth_do_not_drag_each_other() -> None:
    mouth_open = making(weights_of(jawOpen=1.0))
    target = mouth_open.copy()
    target[UPPER] += [0, 2, 0]
    both = vertices_seen(target, CAMERAS, np.append(UPPER, LOWER))
    moves = deform_skin(mouth_open, both, CAMERAS, GENERIC, held=NOWHERE) - mouth_open
    assert np.linalg.norm(moves[LOWER], axis=1).max() < 0.1
    np.testing.assert_allclose(moves[UPPER, 1], 2, atol=0.1)
    alone = vertices_seen(target, CAMERAS, UPPER)
    moves = deform_skin(mouth_open, alone, CAMERAS, GENERIC, held=NOWHERE) - mouth_open
    assert np.linalg.norm(moves[LOWER], axis=1).max() < 1.0, "they hang together at the corners"


def test_lips_that_touch_part() -> None:
    target = NEUTRAL.copy()
    target[UPPER] += [0, 1, 0]
    target[LOWER] -= [0, 1, 0]
    seen = vertices_seen(target, CAMERAS, np.append(UPPER, LOWER))
    moves = deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE) - NEUTRAL
    np.testing.assert_allclose(moves[UPPER, 1], 1, atol=0.1)
    np.testing.assert_allclose(moves[LOWER, 1], -1, atol=0.1)


def test_a_wild_sighting_counts_little(
    moved: Array, seen: SurfaceObservations, found: Array
) -> None:
    wrong = seen.image_points.copy()
    wrong[::20] += [40, -30]
    spoilt = SurfaceObservations(
        **{field.name: getattr(seen, field.name) for field in fields(seen)}
        | {"image_points": wrong}
    )
    robust = deform_skin(NEUTRAL, spoilt, CAMERAS, GENERIC, held=NOWHERE)
    assert np.median(np.linalg.norm(robust - found, axis=1)[FACE]) < 0.05
    assert np.linalg.norm(robust - moved, axis=1)[FACE].max() < 1.5


def test_eyeballs_and_hair_that_are_seen_pull_nothing() -> None:
    ball = np.unique(MESH.triangles[MESH.triangles_of("left_eyeball")])
    seen = vertices_seen(NEUTRAL + np.array([5, 0, 0]), CAMERAS, ball)
    still = deform_skin(NEUTRAL, seen, CAMERAS, GENERIC, held=NOWHERE)
    np.testing.assert_allclose(still, NEUTRAL, atol=1e-9)
