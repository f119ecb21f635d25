from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.errors import InputError
from mien.numeric.rotation import rotation_from_vector
from mien.rig.deformer import fit_units
from mien.rig.unit_transfer import local_stretch, transfer_units
from people import person

GENERIC = load_generic_head()
VERTICES = GENERIC.mesh.vertices


def unit(units: Array, name: str) -> Array:
    return units[GENERIC.unit_names.index(name)]


def test_the_generic_heads_units_are_the_generic_units() -> None:
    units = transfer_units(GENERIC, VERTICES)
    assert units.dtype == np.float32
    np.testing.assert_allclose(units, GENERIC.unit_offsets, atol=1e-3)


@pytest.mark.parametrize(
    "linear",
    [
        1.3 * rotation_from_vector(np.array([0.2, -0.4, 0.1])),
        np.diag([1.2, 1.0, 1.0]),
        np.array([[1.1, 0.1, 0.0], [0.0, 0.9, 0.05], [0.02, 0.0, 1.05]]),
    ],
    ids=["similarity", "wider", "affine"],
)
def test_transfer_commutes_with_a_map_of_the_whole_head(linear: Array) -> None:
    units = transfer_units(GENERIC, VERTICES @ linear.T + [5.0, -3.0, 8.0])
    np.testing.assert_allclose(units, GENERIC.unit_offsets @ linear.T, atol=1e-3)


def test_a_wider_mouth_smiles_wider_and_nothing_else_changes() -> None:
    wide = np.array(VERTICES)
    from_mouth = VERTICES - VERTICES[list(GENERIC.polylines["upper_lip_inner"])].mean(axis=0)
    wide[:, 0] *= 1 + 0.3 * np.exp(-((from_mouth / 50) ** 2).sum(axis=1))
    before, after = (transfer_units(GENERIC, head) for head in (VERTICES, wide))
    corner = GENERIC.vertex_of("left_mouth_corner")
    assert (
        unit(after, "mouthSmileLeft")[corner, 0] > 1.06 * unit(before, "mouthSmileLeft")[corner, 0]
    )
    np.testing.assert_allclose(unit(after, "browInnerUp"), unit(before, "browInnerUp"), atol=0.15)


def test_what_a_unit_does_not_move_stays() -> None:
    units = transfer_units(GENERIC, person(3))
    skin = GENERIC.mesh.vertices_of("skin")
    still = np.abs(GENERIC.unit_offsets[:, skin]).max(axis=2) == 0
    assert not units[:, skin][still].any()


@pytest.mark.parametrize("name", ["jawOpen", "jawForward"])
def test_lower_teeth_move_with_the_jaw_and_stay_behind_the_lower_lip(name: str) -> None:
    head = person(4)
    units = unit(transfer_units(GENERIC, head), name)
    teeth, chin = GENERIC.mesh.vertices_of("lower_teeth"), GENERIC.vertex_of("chin")
    front = teeth[np.argsort(-VERTICES[teeth, 2])[:6]]
    moved = np.linalg.norm(units[front], axis=1) / np.linalg.norm(units[chin])
    generic = unit(GENERIC.unit_offsets, name)
    expected = np.linalg.norm(generic[front], axis=1) / np.linalg.norm(generic[chin])
    np.testing.assert_allclose(moved, expected, atol=0.15)
    lip = GENERIC.polylines["lower_lip_outer"][4]
    assert ((head + units)[front, 2] < (head + units)[lip, 2]).all()


def test_teeth_and_tongue_stay_when_the_jaw_does() -> None:
    parts = GENERIC.mesh.vertices_of("lower_teeth", "upper_teeth", "tongue")
    assert not unit(transfer_units(GENERIC, person(4)), "mouthSmileLeft")[parts].any()


def test_the_stretch_of_an_affine_image_is_its_matrix() -> None:
    linear = np.array([[1.1, 0.1, 0.0], [0.0, 0.9, 0.05], [0.02, 0.0, 1.05]])
    skin = GENERIC.mesh.vertices_of("skin")
    stretch = local_stretch(GENERIC, VERTICES @ linear.T + 4)[skin]
    np.testing.assert_allclose(stretch, np.broadcast_to(linear, stretch.shape), atol=1e-6)


@pytest.mark.parametrize("make", [transfer_units, fit_units])
def test_vertices_of_another_mesh_are_refused(make: object) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=r"vertices: expected shape \(5474, 3\)"):
        make(GENERIC, np.zeros((5, 3)))
