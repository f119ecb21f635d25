from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC, at
from mien.errors import InputError
from mien.head import Verdict
from mien.reconstruction.dense.prior import load_head_prior
from mien.reconstruction.plausibility import (
    MAX_ODDNESS,
    distance_problems,
    judge,
    measure_oddness,
)
from mien.reconstruction.shape.model import shape_model
from people import person

MODEL = shape_model([], GENERIC)
CAMERAS = [at(-20), at(20)]


def test_the_generic_head_is_not_odd_and_people_are_hardly() -> None:
    assert measure_oddness(GENERIC.mesh.vertices, MODEL, GENERIC) < 1e-6
    assert all(measure_oddness(person(k), MODEL, GENERIC) < MAX_ODDNESS for k in range(5))


def test_size_and_place_do_not_count() -> None:
    moved = 1.4 * person(1) + [30.0, -20.0, 400.0]
    assert measure_oddness(moved, MODEL, GENERIC) == pytest.approx(
        measure_oddness(person(1), MODEL, GENERIC), abs=1e-6
    )


def test_a_pancake_is_odd() -> None:
    flat = GENERIC.mesh.vertices * [1.0, 1.0, 0.5]
    assert measure_oddness(flat, MODEL, GENERIC) > MAX_ODDNESS


def test_oddness_is_counted_in_deviations_of_the_prior() -> None:
    """What a millimetre of noise would explain is not counted: it is less than what was drawn."""
    prior = load_head_prior()
    coefficients = np.random.default_rng(0).normal(size=len(prior.components))
    one, two = (
        measure_oddness(prior.vertices(factor * coefficients), MODEL, GENERIC) for factor in (1, 2)
    )
    assert 0.5 < one < 1
    assert two == pytest.approx(2 * one, rel=0.1)


def test_distances() -> None:
    assert distance_problems(CAMERAS) == ()
    near, far = at(0, distance=210.0), at(0, distance=50_000.0)
    mm = f"{near.t_cam_head[2]:.0f}"
    assert distance_problems([near]) == (f"a camera would be {mm} mm from the face",)
    assert distance_problems([CAMERAS[0], far]) == ("a camera would be 50 m from the face",)


def test_grades() -> None:
    assert judge(CAMERAS, 0.5, head=True, registered=True) == Verdict("good")
    one = judge(CAMERAS[:1], 0.5, head=True, registered=False)
    assert one.grade == "fair"
    assert one.reasons[0].startswith("one photo: depth comes from the prior")
    alone = judge(CAMERAS, 0.5, head=True, registered=False)
    assert alone.reasons == ("cameras and shape rest on marks and landmarks alone",)
    assert judge([at(-2), at(2)], 0.5, head=True, registered=True).grade == "fair"
    poor = judge(CAMERAS, 2.0, head=False, registered=True, doubts=["a doubt"])
    assert poor.grade == "poor"
    assert len(poor.reasons) == 2
    assert str(Verdict("poor", ("so", "and so"))) == "poor (so; and so)"
    with pytest.raises(InputError, match="grade: expected good or fair or poor, got great"):
        Verdict("great")  # type: ignore[arg-type]
