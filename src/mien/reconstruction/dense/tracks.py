"""Places on the head's surface followed from photo to photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.reconstruction.dense.crops import Crop, crop_view
from mien.reconstruction.dense.matching import CheckedMatch, SurfaceCrop, match_both
from mien.reconstruction.dense.view_pairs import choose_pairs

MATCH_SIGMA_PX = 0.04
"""Error of a good match, in px of the crop; half of what a round trip misses comes on top."""
_PATCH_PX, _MIN_STEP_PX = 8, 2
"""Side of what is matched at once, and how near to each other two points are followed at most."""
_CANDIDATES = 4
"""Places looked at for each that is wanted: many are seen once, or not found again."""


@dataclass(frozen=True)
class Tracks:
    """N points on the mesh and M observations of them.

    Attributes:
        corners: (N, 3) vertices of the triangle that holds the point.
        barycentrics: (N, 3) in it.
        reference: (N,) the photo in which the point was chosen, and observed exactly.
        photo: (M,) what observation m shows, and where it is seen.
        point: (M,) what observation m shows, and where it is seen.
        image_points: (M, 2) px of that photo.
        sigma_px: (M,) its error there.
        overlap: (N,) how many points share a patch of the matching, and with it its error.
    """

    corners: Int[Array, "n 3"]
    barycentrics: Float[Array, "n 3"]
    reference: Int[Array, " n"]
    photo: Int[Array, " m"]
    point: Int[Array, " m"]
    image_points: Float[Array, "m 2"]
    sigma_px: Float[Array, " m"]
    overlap: Float[Array, " n"]

    def on(self, values: Float[Array, "... v c"]) -> Float[Array, "... n c"]:
        """Per-vertex values at the points."""
        return np.einsum("nc,...ncd->...nd", self.barycentrics, values[..., self.corners, :])

    def of(self, keep: Bool[Array, " n"]) -> Tracks:
        """Some of the points."""
        kept: Array = keep[self.point]
        number = np.cumsum(keep) - 1
        return Tracks(
            self.corners[keep],
            self.barycentrics[keep],
            self.reference[keep],
            self.photo[kept],
            number[self.point[kept]],
            self.image_points[kept],
            self.sigma_px[kept],
            self.overlap[keep],
        )


def find_tracks(
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    mesh: Mesh,
    *,
    mm_per_px: float,
    points: int,
    neighbours: int = 3,
    fine: bool = False,
) -> Tracks:
    """Every photo's grid of surface points, found again in its neighbours.

    Photo b is drawn through the mesh as camera a would see it; what is left between that and
    photo a is the error of cameras and shape, and dense matching measures it. A match counts when
    the way back from b to a agrees and both surroundings look alike.

    Args:
        views: K photos.
        cameras: of the photos.
        mesh: what the photos show (crops.visible_mesh).
        mm_per_px: scale at which to match.
        points: about how many to follow, over all photos.
        neighbours: about how many others each photo is matched with.
        fine: as in optical_flow.
    """
    share = points / max(1, len(views))
    normals = mesh.vertex_normals()
    gathered: list[_Observations | None] = []
    for k, (view, camera) in enumerate(zip(views, cameras, strict=True)):
        crop = crop_view(view, camera, mesh, mm_per_px)
        surface_crop = None if crop is None else SurfaceCrop.of(crop, mesh, normals)
        gathered.append(
            None
            if surface_crop is None
            else _Observations(k, surface_crop, _Grid.on(surface_crop, _CANDIDATES * share))
        )
    for a, b in choose_pairs(cameras, neighbours):
        one, other = gathered[a], gathered[b]
        if one is None or other is None:
            continue
        matches = match_both(one.view, other.view, fine=fine)
        if matches is None:
            continue
        one.add(b, matches[0], other.view.crop)
        other.add(a, matches[1], one.view.crop)
    parts = [seen.tracks(mesh, round(share)) for seen in gathered if seen and seen.photos]
    return _joined(parts) if parts else NO_TRACKS


@dataclass(frozen=True)
class _Grid:
    """Evenly spread pixels of the head: rows and columns (G,), so many px apart."""

    rows: Int[Array, " g"]
    columns: Int[Array, " g"]
    step: int

    @classmethod
    def on(cls, view: SurfaceCrop, count: float) -> _Grid:
        """About `count` of them."""
        wanted = int(np.sqrt(np.count_nonzero(view.usable) / max(count, 1)))
        step = max(_MIN_STEP_PX, wanted)
        first = step // 2
        rows, columns = np.nonzero(view.usable[first::step, first::step])
        return cls(rows * step + first, columns * step + first, step)


class _Observations:
    """What the neighbours of one photo see of its grid."""

    def __init__(self, photo: int, view: SurfaceCrop, grid: _Grid) -> None:
        self.photo, self.view, self.grid = photo, view, grid
        self.photos: list[int] = []
        self.valid: list[Array] = []
        self.points: list[Array] = []
        self.sigma: list[Array] = []

    def add(self, photo: int, match: CheckedMatch, crop: Crop) -> None:
        """What `photo`, seen as `crop`, shows of the grid, and by how much the way back misses."""
        at = self.grid.rows, self.grid.columns
        found, miss = match
        self.photos.append(photo)
        self.valid.append(found.valid[at])
        self.points.append(crop.to_photo(found.points[at]))
        self.sigma.append((MATCH_SIGMA_PX + miss[at] / 2) / crop.scale.mean())

    def tracks(self, mesh: Mesh, most: int) -> Tracks:
        """At most so many points that another photo sees."""
        found = np.any(self.valid, axis=0)
        kept = _thinned(found, most)
        number = np.cumsum(kept) - 1
        count = int(kept.sum())
        rows, columns = self.grid.rows[kept], self.grid.columns[kept]
        crop = self.view.crop
        own = (
            np.full(count, self.photo),
            np.arange(count),
            crop.to_photo(np.column_stack([columns, rows]) + 0.5),
            np.full(count, MATCH_SIGMA_PX / crop.scale.mean()),
        )
        others = []
        for photo, valid, points, sigma in zip(
            self.photos, self.valid, self.points, self.sigma, strict=True
        ):
            at = np.flatnonzero(valid & kept)
            others.append((np.full(len(at), photo), number[at], points[at], sigma[at]))
        columns_of = zip(own, *others, strict=True)
        photo_of, point, image, sigma_px = (np.concatenate(column) for column in columns_of)
        area = self.grid.step**2 * np.count_nonzero(found) / max(count, 1)
        return Tracks(
            corners=mesh.triangles[crop.raster.triangle_ids[rows, columns]],
            barycentrics=crop.raster.barycentrics[rows, columns].astype(np.float64),
            reference=own[0],
            photo=photo_of,
            point=point,
            image_points=image,
            sigma_px=sigma_px,
            overlap=np.full(count, max(1.0, _PATCH_PX**2 / max(area, 1e-9))),
        )


def _joined(parts: list[Tracks]) -> Tracks:
    first = np.cumsum([0, *(len(part.corners) for part in parts)])
    numbered = [
        replace(part, point=part.point + start) for part, start in zip(parts, first, strict=False)
    ]
    names = [field.name for field in fields(Tracks)]
    return Tracks(*(np.concatenate([getattr(part, name) for part in numbered]) for name in names))


def _thinned(found: Bool[Array, " g"], most: int) -> Bool[Array, " g"]:
    """At most so many of those found, evenly."""
    at = np.flatnonzero(found)
    if len(at) > most:
        at = at[np.linspace(0, len(at) - 1, most).round().astype(int)]
    kept = np.zeros(len(found), bool)
    kept[at] = True
    return kept


NO_TRACKS = Tracks(
    corners=np.zeros((0, 3), np.int64),
    barycentrics=np.zeros((0, 3)),
    reference=np.zeros(0, np.int64),
    photo=np.zeros(0, np.int64),
    point=np.zeros(0, np.int64),
    image_points=np.zeros((0, 2)),
    sigma_px=np.zeros(0),
    overlap=np.zeros(0),
)
