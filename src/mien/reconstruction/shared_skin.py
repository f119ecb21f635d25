"""How much skin two photos share: whether they show the same person, the right way round."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.numeric.rotation import angle_between
from mien.reconstruction.dense.crops import visible_mesh
from mien.reconstruction.dense.tracks import find_tracks

ANOTHER_PERSON = "{}: may show another person than {}: hardly any of the skin is alike"
SAME_PERSON = ((12.0, 1900), (25.0, 1150))
"""Points that two photos of a person share at least, by degrees between them. Twenty pairs of one
person share 1,200 to 9,800 (different days, light and expressions included), sixty of two people
400 to 1,880, and 1,190 from 12 degrees on."""
_UNREADABLE = 50
"""Photos that share fewer show nothing that could be compared: two people share some hundreds."""
_MM_PER_PX, _POINTS = 1.2, 40_000


def count_shared(views: Sequence[CapturedView], cameras: Sequence[Camera], mesh: Mesh) -> int:
    """How many points two photos share.

    Args:
        views: two photos.
        cameras: of the photos.
        mesh: what the photos show (crops.visible_mesh).
    """
    tracks = find_tracks(views, cameras, mesh, mm_per_px=_MM_PER_PX, points=_POINTS)
    return len(tracks.corners)


def degrees_between(one: Camera, other: Camera) -> float:
    """Degrees between the rotations of two cameras."""
    return float(np.degrees(angle_between(one.R_cam_head, other.R_cam_head)))


def find_other_people(
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
) -> tuple[str, ...]:
    """A note on each photo that shares too little skin with its neighbour to be of one person.

    Photos that no other looks from near enough to are not judged.

    Args:
        views: K photos.
        cameras: from landmarks or better.
        vertices: (V, 3) mm, of the head.
        generic: the generic head.
    """
    mesh, notes = visible_mesh(generic, vertices), []
    for k in range(1, len(views)):
        turns = [degrees_between(cameras[k], cameras[j]) for j in range(k)]
        j = int(np.argmin(turns))
        least = next((count for degrees, count in SAME_PERSON if turns[j] < degrees), 0)
        pair = (views[j], views[k]), (cameras[j], cameras[k])
        if least and _UNREADABLE <= count_shared(*pair, mesh) < least:
            names = views[k].photo.name, views[j].photo.name
            notes.append(ANOTHER_PERSON.format(*names))
    return tuple(notes)
