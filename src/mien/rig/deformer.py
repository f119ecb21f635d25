"""A face deformed by its units, with rotating eyes and contacts of lids and lips."""

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
    """Contacts of one head: lids with eyeballs, lid with lid, lip with lip.

    Attributes:
        lids: of the left and the right eye.
        lips: upper and lower.
        followers: the lashes and hair that follow the lids and the lips.
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
        lips = resolve_lips(self.lips, vertices)
        lifted = [(lids, resolve_lids(lids, vertices)) for lids in self.lids]
        if lips is None and all(moved is None for _, moved in lifted):
            return vertices
        moves = np.zeros_like(vertices) if lips is None else lips
        for lids, moved in lifted:
            if moved is not None:
                moves[lids.vertices] += moved
        moves[self.followers.vertices] = self.followers.carried(moves)
        moves += vertices
        return moves


@dataclass(frozen=True)
class FaceDeformer:
    """Deforms one head by units, gaze and contacts.

    Attributes:
        gaze_model: rotates the eyes.
        contacts: of lids and lips.
        offsets: of the units; those of the eyeLook units leave out the eyeballs.
        jaw: index of jawOpen.
        close: index of mouthClose.
    """

    gaze_model: GazeModel
    contacts: Contacts
    offsets: SparseOffsets
    jaw: int
    close: int

    nonlinear_units: ClassVar[tuple[str, ...]] = (*EYE_LOOK_UNITS, "mouthClose")
    """Units whose effect is not linear: eyeballs rotate, and mouthClose is limited by jawOpen."""

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
        gaze_model = GazeModel.of(generic, vertices)
        offsets = SparseOffsets.of(gaze_model.without_eyeballs(units))
        jaw, close = (generic.unit_names.index(name) for name in ("jawOpen", "mouthClose"))
        return FaceDeformer(gaze_model, Contacts.of(generic, vertices), offsets, jaw, close)

    def deform(
        self,
        vertices: Float[Array, "v 3"],
        units: Float[Array, " u"],
        gaze: Float[Array, " 2"] = _AHEAD,
        *,
        contacts: bool = True,
    ) -> Float[Array, "v 3"]:
        """(V, 3) mm: the face with units, gaze and contacts applied.

        Args:
            vertices: (V, 3) mm, the neutral or any mixed face.
            units: weights.
            gaze: yaw and pitch, radians, added to that of the units; the lids follow.
            contacts: whether to resolve contacts of lids and lips.
        """
        weights, angles = self.gaze_model.motion(units, gaze)
        weights[self.close] -= max(units[self.close] - max(units[self.jaw], 0.0), 0.0)
        moved = vertices.copy()
        self.offsets.add(weights, moved)
        self.gaze_model.turn(moved, angles)
        return self.contacts.resolve(moved) if contacts else moved


def fit_units(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "52 v 3"]:
    """(52, V, 3) float32 mm: the face units of the person with these neutral vertices.

    Transferred from the generic head, then corrected: eyeballs rotate about their centres, lids
    close and lips meet at weight 1.

    Args:
        generic: the head whose units are transferred.
        vertices: (V, 3) mm, head space, the generic topology.

    Raises:
        InputError: shape, NaN.
    """
    units = transfer_units(generic, vertices)
    units = close_lids(generic, vertices, turn_eyeballs(generic, vertices, units))
    units = separate_lips(generic, vertices, units)
    return units.astype(np.float32)
