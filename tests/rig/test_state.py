from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.rig.state import FaceState, Gaze, PosedFace


def test_the_default_state_is_neutral() -> None:
    state = FaceState()
    assert not state.expressions
    assert not state.units
    assert state.gaze == Gaze(0.0, 0.0)


@pytest.mark.parametrize("angles", [(np.nan, 0.0), (0.0, np.inf)])
def test_gaze_is_finite(angles: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="gaze"):
        Gaze(*angles)


def test_a_posed_face_stays_as_it_is() -> None:
    face = PosedFace(np.zeros((4, 3)), np.full((4, 2), 0.5), np.ones(4))
    for array in (face.vertices, face.weights, face.brightness):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize(
    ("name", "arrays"),
    [
        ("vertices", (np.zeros((4, 2)), np.ones((4, 1)), np.ones(4))),
        ("vertices", (np.full((4, 3), np.nan), np.ones((4, 1)), np.ones(4))),
        ("brightness", (np.zeros((4, 3)), np.ones((4, 1)), np.ones(3))),
        ("weights", (np.zeros((4, 3)), np.ones((3, 1)), np.ones(4))),
        ("weights", (np.zeros((4, 3)), np.full((4, 1), np.inf), np.ones(4))),
    ],
)
def test_arrays_that_do_not_fit(name: str, arrays: tuple[np.ndarray, ...]) -> None:
    with pytest.raises(InputError, match=name):
        PosedFace(*arrays)


def test_the_check_for_finite_numbers_is_optional() -> None:
    unknown = np.full((4, 3), np.nan)
    face = PosedFace(unknown, np.ones((4, 1)), np.ones(4), finite=False)
    assert np.isnan(face.vertices).all()
    with pytest.raises(InputError, match="weights"):
        PosedFace(unknown, np.ones((3, 1)), np.ones(4), finite=False)
