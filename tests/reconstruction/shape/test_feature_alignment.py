"""Heads whose mesh has slid along their surface, and exact landmarks."""

from __future__ import annotations

import numpy as np
import pytest

from expressive import FACE, NEUTRAL, SKIN, bump, features_of
from marbled import GENERIC, at
from mien.arrays import Array
from mien.reconstruction.dense.eyeballs import fit_eyeballs
from mien.reconstruction.features import Features, gather_features
from mien.reconstruction.shape.feature_alignment import align_features
from people import camera, photographed

CAMERAS = [at(-20, 4), at(0), at(20, -4)]
FEATURES = features_of(NEUTRAL, CAMERAS)
NORMALS = GENERIC.mesh.with_vertices(NEUTRAL).vertex_normals()
SLIDES = {
    "left_mouth_corner": (1.0, 0.6, 0.0),
    "right_mouth_corner": (-0.5, 1.0, 0.0),
    "right_eye_outer": (-1.0, 0.5, 0.0),
    "left_eye_inner": (0.5, 1.0, 0.0),
    "nose_tip": (0.0, 1.0, 0.0),
}


def slid(mm: float) -> Array:
    """The person's head with its skin moved along itself by about so much."""
    moves = mm * sum(
        bump(GENERIC.mesh.vertices[GENERIC.vertex_of(name)], width_mm=25, along=along)
        for name, along in SLIDES.items()
    )
    moves -= (moves * NORMALS).sum(axis=1, keepdims=True) * NORMALS
    vertices = NEUTRAL.copy()
    vertices[SKIN] += moves[SKIN]
    return vertices


def off_mm(vertices: Array, features: Features = FEATURES) -> Array:
    """(N,) how far the landmarks on edges lie from where they belong."""
    off: Array = np.linalg.norm(features.on(vertices) - features.on(NEUTRAL), axis=1)
    return off[features.on_edges]


def test_features_come_back_to_their_landmarks() -> None:
    start = slid(2.5)
    guided = align_features(start, FEATURES, CAMERAS, GENERIC, measured=False)
    assert np.median(off_mm(start)) > 1.4
    assert np.median(off_mm(guided)) < 0.5
    assert np.percentile(off_mm(guided), 95) < 0.4 * np.percentile(off_mm(start), 95)
    between, before = (np.linalg.norm(item - NEUTRAL, axis=1)[FACE] for item in (guided, start))
    assert between.mean() < 0.5 * before.mean(), "the skin between them comes along"


def test_one_photo_brings_them_back_as_far_as_it_tells() -> None:
    features = features_of(NEUTRAL, CAMERAS[1:2])
    guided = align_features(slid(2.5), features, CAMERAS[1:2], GENERIC, measured=False)
    seen = CAMERAS[1].project(features.on(guided)) - CAMERAS[1].project(features.on(NEUTRAL))
    px_per_mm = CAMERAS[1].focal_px / CAMERAS[1].t_cam_head[2]
    assert np.median(np.linalg.norm(seen, axis=1)[features.on_edges]) < 0.5 * px_per_mm


@pytest.mark.parametrize("mm", [1.0, 2.5])
def test_a_measured_surface_keeps_its_place(mm: float) -> None:
    start = slid(mm)
    guided = align_features(start, FEATURES, CAMERAS, GENERIC, measured=True)
    moves = guided - start
    normals = GENERIC.mesh.with_vertices(start).vertex_normals()
    across = np.abs((moves * normals).sum(axis=1))[FACE]
    assert np.median(across) < 0.05
    assert np.percentile(across, 95) < 0.5
    assert np.median(off_mm(guided)) < 0.75 * np.median(off_mm(start)), "and yet they are nearer"


@pytest.mark.parametrize("measured", [False, True])
def test_a_head_that_is_right_stays_with_its_eyes_seated(measured: bool) -> None:
    guided = align_features(NEUTRAL, FEATURES, CAMERAS, GENERIC, measured=measured)
    np.testing.assert_allclose(guided, fit_eyeballs(NEUTRAL, GENERIC), atol=1e-9)


def test_landmarks_on_plain_skin_guide_nothing() -> None:
    """A detector guesses them from the others."""
    image = FEATURES.image_points + np.where(FEATURES.on_edges, 0.0, 30.0)[:, None]
    wrong = Features(
        FEATURES.names,
        FEATURES.corners,
        FEATURES.barycentrics,
        image,
        FEATURES.sigma_mm,
        FEATURES.by_hand,
    )
    guided = align_features(NEUTRAL, wrong, CAMERAS, GENERIC, measured=False)
    np.testing.assert_allclose(guided, fit_eyeballs(NEUTRAL, GENERIC), atol=1e-9)


def test_without_landmarks_nothing_moves() -> None:
    marked = gather_features([photographed(NEUTRAL, camera(0))], GENERIC)
    guided = align_features(NEUTRAL, marked, [camera(0)], GENERIC, measured=False)
    np.testing.assert_array_equal(guided, NEUTRAL)


def test_hair_is_held() -> None:
    lifted = NEUTRAL + np.array([0, 4, 0])
    features = features_of(lifted, CAMERAS)
    guided = align_features(NEUTRAL, features, CAMERAS, GENERIC, measured=False)
    scalp = SKIN[GENERIC.regions["scalp"][SKIN] > 0.99]
    assert np.linalg.norm(guided - NEUTRAL, axis=1)[scalp].max() < 0.5
