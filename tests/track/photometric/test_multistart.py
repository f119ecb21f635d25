from __future__ import annotations

from dataclasses import replace

import numpy as np

import patterned
from mien.track.face_model import FaceParameters
from mien.track.parameters import Parameters
from mien.track.photometric.multistart import better_start

NEUTRAL = patterned.model().neutral
START = Parameters(patterned.pose(), NEUTRAL)


def expression(region: str, name: str) -> FaceParameters:
    model = patterned.model()
    alpha = NEUTRAL.alpha.copy()
    row = np.eye(len(patterned.NAMES))[patterned.NAMES.index(name)]
    alpha[model.layout.regions.index(region)] = model.basis.alpha(row)
    return replace(NEUTRAL, alpha=alpha)


def test_no_other_start_where_all_is_explained() -> None:
    level = patterned.level(START)
    assert better_start(level, START, level.image_pair(START)) is None


def test_a_mouth_that_jumped_is_found_by_itself() -> None:
    true = Parameters(START.pose, expression("mouth", "anger"))
    level = patterned.level(true)
    found = better_start(level, START, level.image_pair(START))
    assert found is not None
    weights = patterned.model().weights(found.face)
    np.testing.assert_allclose(weights[0], [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(weights[1:], [[1, 0, 0]] * 2, atol=1e-9)
    assert found.pose is START.pose


def test_closed_lids_are_found() -> None:
    true = Parameters(START.pose, replace(NEUTRAL, units=np.ones(2)))
    level = patterned.level(true)
    found = better_start(level, START, level.image_pair(START))
    assert found is not None
    assert found.face.units.tolist() == [1, 1]
