from __future__ import annotations

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.head import Expression, Head
from mien.rig.regions import ENCLOSING_REGIONS
from mien.rig.state import FaceState
from mien.rig.unit_decomposition import unit_region, units_from_state

GENERIC = load_generic_head()
VERTICES = GENERIC.mesh.vertices
JOY = {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.6, "eyeSquintLeft": 0.4, "noseSneerLeft": 0.2}


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(
        subject="nobody",
        mesh=GENERIC.mesh,
        expressions={
            "neutral": Expression(VERTICES),
            "joy": Expression(VERTICES, units=JOY),
            "awe": Expression(VERTICES, units={"jawOpen": 0.5, "browInnerUp": 1.0}),
        },
        uncertainty_mm=np.ones(len(VERTICES)),
        unit_names=GENERIC.unit_names,
        unit_offsets=GENERIC.unit_offsets,
    )


@pytest.mark.parametrize(
    ("unit", "region"),
    [
        ("mouthSmileLeft", "left_mouth"),
        ("mouthLeft", "mouth"),
        ("jawRight", "mouth"),
        ("tongueOut", "mouth"),
        ("cheekPuff", "mouth"),
        ("cheekSquintRight", "right_eye"),
        ("eyeBlinkRight", "right_eye"),
        ("browInnerUp", "forehead"),
        ("browDownLeft", "left_forehead"),
        ("noseSneerLeft", "face"),
    ],
)
def test_regions_of_units(unit: str, region: str) -> None:
    assert unit_region(unit) == region


def test_every_unit_has_a_region() -> None:
    assert {unit_region(unit) for unit in GENERIC.unit_names} <= set(ENCLOSING_REGIONS)


def test_units_stay_themselves(head: Head) -> None:
    assert units_from_state(head, FaceState(units={"jawOpen": 0.3})) == {"jawOpen": 0.3}


def test_an_expression_is_its_units(head: Head) -> None:
    assert units_from_state(head, FaceState({"face": {"joy": 1.0}})) == JOY


def test_a_mixture_adds_up(head: Head) -> None:
    state = FaceState({"face": {"joy": 0.5, "awe": 0.5, "neutral": 0.0}}, {"jawOpen": 0.125})
    expected = {name: 0.5 * weight for name, weight in JOY.items()}
    expected |= {"jawOpen": 0.375, "browInnerUp": 0.5}
    assert units_from_state(head, state) == expected


def test_a_regions_weights_hold_instead_of_the_faces(head: Head) -> None:
    state = FaceState({"face": {"joy": 1.0}, "mouth": {"awe": 1.0}, "left_mouth": {"joy": 0.5}})
    expected = {"mouthSmileLeft": 0.4, "eyeSquintLeft": 0.4, "noseSneerLeft": 0.2, "jawOpen": 0.5}
    assert units_from_state(head, state) == expected
