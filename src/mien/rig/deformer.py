"""Faces after their units have been added up: eyes that turn, lids and lips that touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.assets.generic import GenericHead
from mien.rig.contacts.lids import Lids, close_lids, resolve_lids
from mien.rig.contacts.lips import Lips, resolve_lips, separate_lips
from mien.rig.followers import Followers
from mien.rig.gaze import EYE_LOOK_UNITS, SIDES, GazeModel, turn_eyeballs
from mien.rig.sparse_offsets import SparseOffsets
from mien.rig.unit_transfer import transfer_units

_AHEAD = frozen(np.zeros(2))


@dataclass(frozen=True)
class Contacts:
    """What must not pass through what on one head: lids and eyeballs, lid and lid, lip and lip.

    Attributes:
        lids: of the left and the right eye.
        lips: upper and lower.
        followers: of lashes and hair what goes with the lids and the lips.
    """

    lids: tuple[Lids, Lids]
    lips: Lips
    followers: Followers

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Contacts:
        """For a head with these neutral vertices, (V, 3) mm. Raises: InputError: shape, NaN."""
        vertices = check_array("vertices", vertices, generic.mesh.vertices.shape)
        left, right = (Lids.of(generic, vertices, side) for side in SIDES)
        lips, followers = Lips.of(generic, vertices), Followers.of(generic)
        touching = [item.vertices for item in (left, right, lips.upper, lips.lower)]
        return Contacts((left, right), lips, followers.of_skin(np.concatenate(touching)))

    def resolve(self, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
        """(V, 3) mm with every contact resolved; the same array where there is none."""
        parted = resolve_lips(self.lips, vertices)
        lifted = [(lids, resolve_lids(lids, vertices)) for lids in self.lids]
        if parted is None and all(moved is None for _, moved in lifted):
            return vertices
        moves = np.zeros_like(vertices) if parted is None else parted
        for lids, moved in lifted:
            if moved is not None:
                moves[lids.vertices] += moved
        moves[self.followers.vertices] = self.followers.carried(moves)
        moves += vertices
        return moves


@dataclass(frozen=True)
class FaceDeformer:
    """How units, gaze and contacts move one head.

    Attributes:
        look: how the eyes turn.
        contacts: what must not pass through what.
        offsets: of the units; the eyeLook units' leave the eyeballs to be turned.
        jaw: which units jawOpen and mouthClose are.
        close: which units jawOpen and mouthClose are.
    """

    gaze_model: GazeModel
    contacts: Contacts
    offsets: SparseOffsets
    jaw: int
    close: int

    nonlinear_units: ClassVar[tuple[str, ...]] = (*EYE_LOOK_UNITS, "mouthClose")
    """Units that do something else than add their offsets: eyeballs turn, and a mouth can be
    closed only as far as the jaw is open."""

    @staticmethod
    def of(
        generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
    ) -> FaceDeformer:
        """For a head with these neutral vertices and unit offsets, mm.

        Raises:
            InputError: shape, NaN.
        """
        units = check_array("units", units, generic.unit_offsets.shape)
        vertices = check_array("vertices", vertices, generic.mesh.vertices.shape)
        look = GazeModel.of(generic, vertices)
        offsets = SparseOffsets.of(look.without_eyeballs(units))
        jaw, close = (generic.unit_names.index(name) for name in ("jawOpen", "mouthClose"))
        return FaceDeformer(look, Contacts.of(generic, vertices), offsets, jaw, close)

    def deform(
        self,
        vertices: Float[Array, "v 3"],
        units: Float[Array, " u"],
        gaze: Float[Array, " 2"] = _AHEAD,
        *,
        contacts: bool = True,
    ) -> Float[Array, "v 3"]:
        """(V, 3) mm: the face as its units move it, as it looks and touches.

        Args:
            vertices: (V, 3) mm, the neutral or any mixed face.
            units: weights.
            gaze: yaw and pitch, radians; in addition to what the units say; the lids go along.
            contacts: off where lids and lips may pass through each other.
        """
        weights, angles = self.gaze_model.motion(units, gaze)
        weights[self.close] -= max(units[self.close] - max(units[self.jaw], 0.0), 0.0)
        moved = vertices.copy()
        self.offsets.add(weights, moved)
        self.gaze_model.turn(moved, angles)
        return self.contacts.resolve(moved) if contacts else moved


def fit_units(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "52 v 3"]:
    """(52, V, 3) float32 mm: the face units of the person with these neutral vertices.

    Transferred from the generic head; eyeballs that turn about their centres, lids that close and
    lips that meet at weight 1.

    Args:
        vertices: (V, 3) mm, head space, the generic topology.

    Raises:
        InputError: shape, NaN.
    """
    units = transfer_units(generic, vertices)
    units = close_lids(generic, vertices, turn_eyeballs(generic, vertices, units))
    units = separate_lips(generic, vertices, units)
    return units.astype(np.float32)
