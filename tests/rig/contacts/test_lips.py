from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.rig.contacts.lips import Lips, resolve_lips

if TYPE_CHECKING:
    from conftest import Rigged

GENERIC = load_generic_head()
MOUTH_UNITS = [
    name for name in GENERIC.unit_names if name.startswith(("mouth", "jaw", "cheekPuff", "tongue"))
]


def pressed(lips: Lips, vertices: np.ndarray) -> float:
    """mm by which a lip is deeper in the other one than when the face is neutral."""
    return float((lips.depths(vertices) - lips.allowed).max())


@pytest.mark.parametrize("name", MOUTH_UNITS)
def test_no_unit_pushes_one_lip_into_the_other(rigged: Rigged, name: str) -> None:
    weights = {name: 1.0} | ({"jawOpen": 1.0} if name == "mouthClose" else {})
    lips = rigged.deformer.contacts.lips
    assert pressed(lips, rigged.posed(**weights)) < 0.5
    assert pressed(lips, rigged.living(**weights)) < 0.5


@pytest.mark.parametrize(
    "weights",
    [
        {"mouthPucker": 1.0, "mouthShrugLower": 0.6},
        {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8, "mouthPressLeft": 0.7},
        {"mouthRollLower": 0.5},
        {"jawOpen": 0.3, "mouthClose": 0.3, "mouthFunnel": 0.4},
    ],
)
def test_in_mixtures_lips_do_not_pass_through_each_other(
    rigged: Rigged, weights: dict[str, float]
) -> None:
    lips = rigged.deformer.contacts.lips
    assert pressed(lips, rigged.living(**weights)) < 0.5


def test_an_open_jaw_with_closed_lips_is_closed(rigged: Rigged) -> None:
    line = [GENERIC.polylines[f"{which}_lip_inner"][3] for which in ("upper", "lower")]
    neutral, opened, closed = (
        vertices[line[0], 1] - vertices[line[1], 1]
        for vertices in (
            rigged.neutral,
            rigged.posed(jawOpen=1.0),
            rigged.living(jawOpen=1.0, mouthClose=1.0),
        )
    )
    assert opened > 20
    assert closed == pytest.approx(neutral, abs=3.0)


def test_lips_without_contact_are_left_alone(rigged: Rigged) -> None:
    lips = rigged.deformer.contacts.lips
    assert resolve_lips(lips, rigged.neutral) is None
    assert resolve_lips(lips, rigged.posed(jawOpen=0.5)) is None


def test_pushed_lips_part_and_the_rest_of_the_face_stays(rigged: Rigged) -> None:
    lips = rigged.deformer.contacts.lips
    pushed = rigged.neutral.copy()
    red = GENERIC.regions["lips"][lips.lower.vertices]
    pushed[lips.lower.vertices, 1] += 1.5 * red
    before = pressed(lips, pushed)
    moved = resolve_lips(lips, pushed)
    assert before > 0.5
    assert moved is not None
    assert pressed(lips, pushed + moved) < 0.5 * before
    elsewhere = np.setdiff1d(
        np.arange(len(pushed)), np.concatenate([lips.upper.vertices, lips.lower.vertices])
    )
    assert not moved[elsewhere].any()
    assert (moved[lips.upper.vertices, 1] >= 0).all()
    assert (moved[lips.lower.vertices, 1] <= 0).all()
