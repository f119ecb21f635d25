from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.errors import InputError
from mien.rig.deformer import Contacts, FaceDeformer
from mien.rig.followers import Followers
from mien.rig.gaze import EYE_LOOK_UNITS

if TYPE_CHECKING:
    from conftest import Rigged

GENERIC = load_generic_head()


def test_without_contact_the_very_same_array_comes_back(rigged: Rigged) -> None:
    contacts = rigged.deformer.contacts
    for posed in (rigged.neutral, rigged.posed(jawOpen=0.4), rigged.posed(browInnerUp=1.0)):
        assert contacts.resolve(posed) is posed


def test_the_input_is_not_written_to(rigged: Rigged) -> None:
    posed = rigged.posed(eyeBlinkLeft=1.0, eyeLookDownLeft=1.0)
    kept = posed.copy()
    resolved = rigged.deformer.contacts.resolve(posed)
    np.testing.assert_array_equal(posed, kept)
    assert np.abs(resolved - posed).max() > 0.5


def test_a_mouth_closes_only_as_far_as_the_jaw_is_open(rigged: Rigged) -> None:
    alone = rigged.living(mouthClose=1.0)
    np.testing.assert_allclose(alone, rigged.neutral, atol=1e-5)
    np.testing.assert_allclose(
        rigged.living(mouthClose=0.8, jawOpen=0.3),
        rigged.living(mouthClose=0.3, jawOpen=0.3),
        atol=1e-5,
    )


def test_nonlinear_units_are_listed() -> None:
    assert set(FaceDeformer.nonlinear_units) == {*EYE_LOOK_UNITS, "mouthClose"}
    assert set(FaceDeformer.nonlinear_units) <= set(GENERIC.unit_names)


def test_lashes_go_with_the_lid(rigged: Rigged) -> None:
    posed = rigged.posed(eyeBlinkLeft=1.0, eyeLookDownLeft=1.0)
    moved = rigged.deformer.contacts.resolve(posed) - posed
    followers = rigged.deformer.contacts.followers
    lashes = np.isin(followers.vertices, GENERIC.mesh.vertices_of("lashes"))
    skin = moved[followers.carriers[lashes]]
    assert np.abs(moved[followers.vertices[lashes]]).max() > 0.5
    assert (moved[followers.vertices[lashes]] <= skin.max(axis=1) + 1e-9).all()
    assert (moved[followers.vertices[lashes]] >= skin.min(axis=1) - 1e-9).all()


def test_followers_of_other_skin_are_left_out(rigged: Rigged) -> None:
    contacts = rigged.deformer.contacts
    touching = [*contacts.lids, contacts.lips.upper, contacts.lips.lower]
    moves = np.zeros_like(rigged.neutral)
    moves[np.concatenate([item.vertices for item in touching])] = [1.0, 2.0, 3.0]
    whole, some = Followers.of(GENERIC), contacts.followers
    expected = np.zeros_like(moves)
    expected[whole.vertices] = whole.carried(moves)
    moved = expected.any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(moved), some.vertices)
    np.testing.assert_allclose(some.carried(moves), expected[moved])


def test_bad_vertices_are_refused() -> None:
    with pytest.raises(InputError, match=r"vertices: expected shape"):
        Contacts.of(GENERIC, np.zeros((3, 3)))
    with pytest.raises(InputError, match=r"units: expected shape"):
        FaceDeformer.of(GENERIC, GENERIC.mesh.vertices, np.zeros((3, 3, 3)))
