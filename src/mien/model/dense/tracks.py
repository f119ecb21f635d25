"""Places on the head's surface followed from photo to photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.capture.source import View
from mien.mesh import Mesh
from mien.model.dense.crops import Crop, crop_view
from mien.model.dense.matching import Match, Sight, check_match, match_sights
from mien.model.dense.neighbours import choose_pairs

MATCH_SIGMA_PX = 0.04
"""Error of a good match, in px of the crop; half of what a round trip misses comes on top."""
_CANDIDATES = 4
"""Places looked at for each that is wanted: many are seen once, or not found again."""


@dataclass(frozen=True)
class Tracks:
    """N places on the mesh and M observations of them.

    Attributes:
        corners: (N, 3) vertices of the triangle that holds the place; barycentrics: (N, 3) in it.
        reference: (N,) the photo in which the place was chosen, and observed exactly.
        photo, place: (M,) what observation m shows, and where it is seen.
        image_points: (M, 2) px of that photo. sigma_px: (M,) its error there.
    """

    corners: Int[Array, "n 3"]
    barycentrics: Float[Array, "n 3"]
    reference: Int[Array, " n"]
    photo: Int[Array, " m"]
    place: Int[Array, " m"]
    image_points: Float[Array, "m 2"]
    sigma_px: Float[Array, " m"]

    def on(self, values: Float[Array, "... v c"]) -> Float[Array, "... n c"]:
        """Per-vertex values at the places."""
        at: Array = np.einsum("nc,...ncd->...nd", self.barycentrics, values[..., self.corners, :])
        return at

    def of(self, keep: Bool[Array, " n"]) -> Tracks:
        """Some of the places."""
        kept: Array = keep[self.place]
        number = np.cumsum(keep) - 1
        return Tracks(
            self.corners[keep],
            self.barycentrics[keep],
            self.reference[keep],
            self.photo[kept],
            number[self.place[kept]],
            self.image_points[kept],
            self.sigma_px[kept],
        )


def find_tracks(
    views: Sequence[View],
    cameras: Sequence[Camera],
    mesh: Mesh,
    *,
    mm_per_px: float,
    places: int,
    neighbours: int = 3,
) -> Tracks:
    """Every photo's grid of surface places, found again in its neighbours.

    Photo b is drawn through the mesh as camera a would see it; what is left between that and
    photo a is the error of cameras and shape, and dense matching measures it. A match counts when
    the way back from b to a agrees and both surroundings look alike.

    Args:
        mesh: what the photos show (crops.visible_mesh). mm_per_px: scale at which to match.
        places: about how many to follow, over all photos.
    """
    crops = [
        crop_view(view, camera, mesh, mm_per_px)
        for view, camera in zip(views, cameras, strict=True)
    ]
    normals = mesh.vertex_normals()
    seen = [None if crop is None else Sight.of(crop, mesh, normals) for crop in crops]
    share = places / max(1, len(views))
    grids = [None if view is None else _grid(view, _CANDIDATES * share) for view in seen]
    gathered = [_Observations(k) for k in range(len(views))]
    for a, b in choose_pairs(cameras, neighbours):
        one, other = seen[a], seen[b]
        if one is None or other is None:
            continue
        there, back = match_sights(one, other), match_sights(other, one)
        if there is None or back is None:
            continue
        gathered[a].add(b, grids[a], check_match(there, back), other.crop)
        gathered[b].add(a, grids[b], check_match(back, there), one.crop)
    return _assembled(gathered, seen, grids, mesh, round(share))


def _grid(view: Sight, count: float) -> tuple[Int[Array, " g"], Int[Array, " g"]]:
    """Rows and columns of about so many pixels of the head, evenly spread."""
    step = max(1, int(np.sqrt(np.count_nonzero(view.usable) / max(count, 1))))
    rows, columns = np.nonzero(view.usable[step // 2 :: step, step // 2 :: step])
    return rows * step + step // 2, columns * step + step // 2


class _Observations:
    """What the neighbours of one photo see of its grid."""

    def __init__(self, photo: int) -> None:
        self.photo = photo
        self.photos: list[int] = []
        self.good: list[Array] = []
        self.places: list[Array] = []
        self.sigma: list[Array] = []

    def add(
        self, photo: int, grid: tuple[Array, Array] | None, match: tuple[Match, Array], crop: Crop
    ) -> None:
        found, miss = match
        self.photos.append(photo)
        self.good.append(found.good[grid])
        self.places.append(crop.to_photo(found.places[grid]))
        self.sigma.append((MATCH_SIGMA_PX + miss[grid] / 2) / crop.scale.mean())


def _assembled(
    gathered: list[_Observations],
    seen: list[Sight | None],
    grids: list[tuple[Array, Array] | None],
    mesh: Mesh,
    most: int,
) -> Tracks:
    parts: list[Tracks] = []
    first = 0
    for observations in gathered:
        view, grid = seen[observations.photo], grids[observations.photo]
        if view is None or grid is None or not observations.photos:
            continue
        kept = _thinned(np.any(observations.good, axis=0), most)
        number = first + np.cumsum(kept) - 1
        first += int(kept.sum())
        rows, columns = grid[0][kept], grid[1][kept]
        crop = view.crop
        own = crop.to_photo(np.column_stack([columns, rows]) + 0.5)
        count = len(rows)
        found = [np.flatnonzero(good & kept) for good in observations.good]
        seen_by = [
            (np.full(len(at), k), at, xy[at], sd[at])
            for k, at, xy, sd in zip(
                observations.photos, found, observations.places, observations.sigma, strict=True
            )
        ]
        reference = np.full(count, observations.photo)
        exact = np.full(count, MATCH_SIGMA_PX / crop.scale.mean())
        photo, at, image, sigma = (
            np.concatenate(column)
            for column in zip((reference, np.flatnonzero(kept), own, exact), *seen_by, strict=True)
        )
        parts.append(
            Tracks(
                corners=mesh.triangles[crop.raster.triangle_ids[rows, columns]],
                barycentrics=crop.raster.barycentrics[rows, columns].astype(np.float64),
                reference=reference,
                photo=photo,
                place=number[at],
                image_points=image,
                sigma_px=sigma,
            )
        )
    if not parts:
        return _no_tracks()
    return Tracks(
        *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Tracks))
    )


def _thinned(found: Bool[Array, " g"], most: int) -> Bool[Array, " g"]:
    """At most so many of those found, evenly."""
    at = np.flatnonzero(found)
    if len(at) > most:
        at = at[np.linspace(0, len(at) - 1, most).round().astype(int)]
    kept = np.zeros(len(found), bool)
    kept[at] = True
    return kept


def _no_tracks() -> Tracks:
    none = np.zeros(0, np.int64)
    return Tracks(
        np.zeros((0, 3), np.int64),
        np.zeros((0, 3)),
        none,
        none,
        none,
        np.zeros((0, 2)),
        np.zeros(0),
    )
