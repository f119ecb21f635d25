"""Faces after their units have been added up: eyes that turn, lids and lips that touch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mien.arrays import Array, Float, check_array, frozen
from mien.assets.generic import GenericHead
from mien.expressions.followers import Followers
from mien.expressions.gaze import LOOK_UNITS, SIDES, Look, turn_eyeballs
from mien.expressions.lids import Lids, close_lids, resolve_lids
from mien.expressions.lips import Lips, part_lips, resolve_lips
from mien.expressions.state import Gaze
from mien.expressions.transfer import transfer_units


@dataclass(frozen=True)
class Contacts:
    """What must not pass through what on one head: lids and eyeballs, lid and lid, lip and lip.

    Attributes:
        lids: of the left and the right eye.
        lips: upper and lower.
        followers: the lashes and the hair, which go with the lids.
    """

    lids: tuple[Lids, Lids]
    lips: Lips
    followers: Followers

    @staticmethod
    def of(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Contacts:
        """For a head with these neutral vertices, (V, 3) mm. Raises: InputError: shape, NaN."""
        vertices = check_array("vertices", vertices, generic.mesh.vertices.shape)
        left, right = (Lids.of(generic, vertices, side) for side in SIDES)
        return Contacts((left, right), Lips.of(generic, vertices), Followers.of(generic))

    def resolved(self, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
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
class Mechanics:
    """The motions of one head that are no sum of offsets: turning eyes, and contacts.

    Attributes:
        look: how the eyes turn.
        contacts: what must not pass through what.
        close: (V, 3) mm, the offsets of mouthClose.
    """

    look: Look
    contacts: Contacts
    close: Float[Array, "v 3"]

    taken_over: ClassVar[tuple[str, ...]] = (*LOOK_UNITS, "mouthClose")
    """Units that do something else than add their offsets: eyeballs turn, and a mouth can be
    closed only as far as the jaw is open."""

    @staticmethod
    def of(
        generic: GenericHead, vertices: Float[Array, "v 3"], units: Float[Array, "52 v 3"]
    ) -> Mechanics:
        """For a head with these neutral vertices and unit offsets, mm.

        Raises: InputError: shape, NaN.
        """
        units = check_array("units", units, generic.unit_offsets.shape)
        vertices = check_array("vertices", vertices, generic.mesh.vertices.shape)
        close = frozen(units[generic.unit_names.index("mouthClose")])
        return Mechanics(Look.of(generic, vertices, units), Contacts.of(generic, vertices), close)

    def applied(
        self,
        vertices: Float[Array, "v 3"],
        units: Mapping[str, float],
        gaze: Gaze | None = None,
        *,
        contacts: bool = True,
    ) -> Float[Array, "v 3"]:
        """(V, 3) mm: the face as it looks and touches; the same array where it does neither.

        Args:
            vertices: (V, 3) mm, the neutral or any mixed face with all units added as offsets,
                those of `taken_over` too.
            units: weights by name.
            gaze: in addition to what the units say; the lids go along.
            contacts: off where a face is to be as it was photographed.
        """
        idle = units.get("mouthClose", 0.0) - max(units.get("jawOpen", 0.0), 0.0)
        if idle > 0:
            vertices = vertices - idle * self.close
        vertices = self.look.applied(vertices, units, gaze or Gaze())
        return self.contacts.resolved(vertices) if contacts else vertices


def fit_units(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "52 v 3"]:
    """(52, V, 3) float32 mm: the face units of the person with these neutral vertices.

    Transferred from the generic head; eyeballs that turn about their centres, lids that close and
    lips that meet at weight 1.

    Args:
        vertices: (V, 3) mm, head space, the generic topology.
    Raises: InputError: shape, NaN.
    """
    units = transfer_units(generic, vertices)
    units = close_lids(generic, vertices, turn_eyeballs(generic, vertices, units))
    units = part_lips(generic, vertices, units)
    return units.astype(np.float32)
