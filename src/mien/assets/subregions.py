"""The 14 subregions that a face is synthesised in, drawn as polygons of its feature points."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from mien.arrays import Array, Bool, Float, Int, check_array, frozen
from mien.assets.data_file import affine_weights, read_data
from mien.assets.feature_points import FeatureLayout
from mien.errors import DocumentError, InputError
from mien.reading.strict_json import JsonValue

__all__ = ["SubregionDrawing", "Subregions", "default_subregions", "load_subregion_drawing"]

_FORMAT = "mien subregions"
_TEMPLATE_WIDTH_PX = 300
_MAX_SUM = 1.001
"""Of all subregions together at a pixel: 1, but for rounding."""


@dataclass(frozen=True)
class SubregionDrawing:
    """Subregions over a layout, whosever face it is on. Later ones are painted over earlier ones.

    Attributes:
        names: of the subregions.
        groups: within a group, neighbours blend; between groups borders are hard. The first one's
            group fades out around the face.
        corners: of each polygon, (c, n + k): weights of the layout's points and its frame's.
        blends: width of the blend along each one's borders, in widths of the face; one a group.
        extra_points: of each, indices of points that belong to it wherever they lie.
    """

    names: tuple[str, ...]
    groups: tuple[str, ...]
    corners: tuple[Float[Array, "c points"], ...]
    blends: tuple[float, ...]
    extra_points: tuple[Int[Array, " a"], ...]


@dataclass(frozen=True)
class Subregions:
    """The subregions on a person's standard image ([Zhang 2006] section 5.3, Fig. 2b).

    Attributes:
        names: R of them, teeth last.
        fades: (h, w, R) float32, each pixel's blend weights; they sum to 1 inside of the face and
            fall to 0 around it.
        members: of each, the indices of the feature points within it or on its boundary, and of
            others that belong to it: lids follow the pupil.

    Raises:
        InputError: two of one name, fades for another number of them, below 0 or together above 1,
            one without a point.
    """

    names: tuple[str, ...]
    fades: Float[Array, "h w r"]
    members: tuple[Int[Array, " m"], ...]

    def __post_init__(self) -> None:
        """Check values that may come from a user's drawing."""
        count = len(self.names)
        if len(set(self.names)) < count:
            raise InputError("subregions", "names of their own", ", ".join(self.names))
        fades = check_array("fades", self.fades, (None, None, count), dtype=np.float32)
        object.__setattr__(self, "fades", fades)
        if not (fades.min(initial=0) >= 0 and fades.sum(axis=2).max(initial=0) <= _MAX_SUM):
            found = f"{fades.min():g} and a sum of {fades.sum(axis=2).max():g}"
            raise InputError("fades", "shares from 0 on that sum to 1 at most", found)
        if len(self.members) != count:
            raise InputError("members", f"of each of {count} subregions", len(self.members))
        for name, members in zip(self.names, self.members, strict=True):
            kind = members.dtype.kind
            if members.ndim != 1 or kind not in "iu" or not members.size or members.min() < 0:
                found = f"{members.dtype} of shape {members.shape}: {str(members)[:40]}"
                raise InputError(f"members of {name}", "indices of points, one at least", found)


def default_subregions(
    layout: FeatureLayout,
    standard_points: Float[Array, "n 2"],
    size: tuple[int, int],
    *,
    drawing: SubregionDrawing | None = None,
) -> Subregions:
    """The subregions over a person's standard image.

    Args:
        layout: the feature points.
        standard_points: (n, 2) px of the standard image.
        size: its width and height.
        drawing: another one than mien's own.

    Raises:
        InputError: shapes, NaN, no pixels.

    Source:
        [Zhang 2006] sections 5.3 and 7, eq. (7), Fig. 3b.
    """
    points = check_array("standard_points", standard_points, (len(layout.names), 2))
    if min(size) < 1:
        raise InputError("size", "a width and height of at least 1", size)
    drawing = drawing or load_subregion_drawing(layout)
    return Subregions(
        names=drawing.names,
        fades=frozen(_fades(layout, drawing, points, size)),
        members=_members(layout, drawing),
    )


def _fades(
    layout: FeatureLayout, drawing: SubregionDrawing, points: Array, size: tuple[int, int]
) -> Float[Array, "h w r"]:
    """Blend weights by eq. (7): linear across a border, half on it; none across hard borders."""
    labels = _painted(layout, drawing, points, size)
    widths = np.array(drawing.blends) * float(np.ptp(points[:, 0]))
    groups = np.array([sorted(set(drawing.groups)).index(group) for group in drawing.groups])
    fades = np.zeros((*labels.shape, len(drawing.names)), np.float32)
    # Off the face, every pixel goes on with the group of the skin.
    group_of = np.where(labels >= 0, groups[labels], groups[0])
    for region, group in enumerate(groups):
        inside, same_group = labels == region, np.isin(labels, np.flatnonzero(groups == group))
        depth = _distance_to(same_group & ~inside) - _distance_to(inside)
        depth -= 0.5 * np.sign(depth)  # Borders run between the centres of pixels.
        fades[..., region] = np.clip(0.5 + depth / widths[region], 0, 1) * (group_of == group)
    fades /= fades.sum(axis=2, keepdims=True)
    # Half of it within the outline: what examples of a turned head show outside is wall or hair.
    depth = _distance_to(labels < 0) - _distance_to(labels >= 0)
    depth -= 0.5 * np.sign(depth)
    fades *= np.clip(0.5 + depth / widths[0], 0, 1)[..., None]
    return fades


def _painted(
    layout: FeatureLayout, drawing: SubregionDrawing, points: Array, size: tuple[int, int]
) -> Int[Array, "h w"]:
    """Each pixel's subregion, -1 off the face."""
    import cv2

    places = np.vstack([points, layout.frame(points)])
    labels = np.full((size[1], size[0]), -1, np.int16)
    for region, corners in enumerate(drawing.corners):
        # Sixteenths of a pixel, counted from the centre of the first one.
        polygon = np.round((corners @ places - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(labels, [polygon], region, shift=4)
    return labels


def _distance_to(mask: Bool[Array, "h w"]) -> Float[Array, "h w"]:
    """From each pixel to the nearest one in the mask, px; 1e6 where there is none."""
    import cv2

    if not mask.any():
        return np.full(mask.shape, 1e6, np.float32)
    return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _members(layout: FeatureLayout, drawing: SubregionDrawing) -> tuple[Int[Array, " m"], ...]:
    """Points within a subregion or its blend on the template, and those named for it."""
    low = np.minimum(layout.template.min(axis=0), layout.template_frame.min(axis=0))
    points = (layout.template - low) * _TEMPLATE_WIDTH_PX
    size = np.ceil((layout.template_frame.max(axis=0) - low) * _TEMPLATE_WIDTH_PX).astype(int) + 1
    labels = _painted(layout, drawing, points, (int(size[0]), int(size[1])))
    columns, rows = np.floor(points).astype(int).T
    members = []
    for region, (blend, also) in enumerate(zip(drawing.blends, drawing.extra_points, strict=True)):
        distances = _distance_to(labels == region)[rows, columns]
        within = np.flatnonzero(distances <= blend / 2 * _TEMPLATE_WIDTH_PX)
        members.append(frozen(np.union1d(within, also)))
    return tuple(members)


def load_subregion_drawing(
    layout: FeatureLayout, path: str | Path | None = None
) -> SubregionDrawing:
    """The 14 subregions that ship with mien, or those of a file of the same kind.

    Raises:
        InputError: the file cannot be read.
        FileFormatError: no subregions over this layout.
    """
    shipped = str(files("mien.assets") / "data" / "zhang134_subregions.json")
    return read_data(Path(path or shipped), _FORMAT, lambda document: _drawing(document, layout))


@dataclass(frozen=True)
class _Region:
    group: str
    corners: Float[Array, "c points"]
    also: Int[Array, " a"]


def _drawing(document: JsonValue, layout: FeatureLayout) -> SubregionDrawing:
    stated = document["layout"]
    if stated.text() != layout.name:
        raise stated.error(f"expected {layout.name!r}, found {stated.raw[:40]!r}")
    blends = {name: _width(width) for name, width in document["groups"].members().items()}
    regions: dict[str, _Region] = {}
    for entry in document["regions"].items():
        name = entry["name"].text()
        if name in regions:
            raise entry.error(f"{name!r} appears twice")
        regions[name] = region = _region(JsonValue(entry.raw, name), regions, layout)
        if region.group not in blends:
            raise DocumentError(f"{name}.group", f"unknown group {region.group[:40]!r}")
    if not regions:
        raise DocumentError("regions", "expected at least one")
    return SubregionDrawing(
        names=tuple(regions),
        groups=tuple(region.group for region in regions.values()),
        corners=tuple(frozen(region.corners) for region in regions.values()),
        blends=tuple(blends[region.group] for region in regions.values()),
        extra_points=tuple(frozen(region.also) for region in regions.values()),
    )


def _region(entry: JsonValue, before: dict[str, _Region], layout: FeatureLayout) -> _Region:
    """A region as drawn, or an earlier one mirrored to the other side of the face."""
    if "mirror_of" not in entry:
        also = _points(entry["also"], layout) if "also" in entry else []
        group = entry["group"].text()
        return _Region(group, _polygon(entry, layout), np.array(also, dtype=np.intp))
    mirrored = entry["mirror_of"]
    original = before.get(mirrored.text())
    if original is None:
        raise mirrored.error(f"no subregion {mirrored.raw!r} before this one")
    group = entry.get("group", original.group).text()
    return _Region(group, _mirrored(original.corners, layout), layout.mirror[original.also])


def _points(members: JsonValue, layout: FeatureLayout) -> list[int]:
    if not isinstance(members.raw, list):
        raise members.error("expected a list of points")
    for member in members.raw:
        if member not in layout.names:
            raise members.error(f"unknown point {str(member)[:40]!r}")
    return [layout.index(member) for member in members.raw]


def _width(value: JsonValue) -> float:
    number = value.number()
    if not 0 < number < 1:
        raise value.error(f"expected a number between 0 and 1, found {number:g}")
    return number


def _polygon(region: JsonValue, layout: FeatureLayout) -> Float[Array, "c points"]:
    frame = [f"frame.{i}" for i in range(len(layout.template_frame))]
    index = {point: i for i, point in enumerate((*layout.names, *frame))}
    corners = region["corners"].items()
    polygon = np.zeros((len(corners), len(index)))
    for row, corner in zip(polygon, corners, strict=True):
        if not isinstance(corner.raw, dict):
            raise corner.error("expected an object of shares by point")
        found = affine_weights(corner, index.get)
        row[list(found)] = list(found.values())
    if region.get("symmetric", False).raw:
        polygon = np.vstack([polygon, _mirrored(polygon, layout)[::-1]])
    if len(polygon) < 3:
        raise region["corners"].error(f"expected at least 3, found {len(polygon)}")
    return polygon


def _mirrored(polygon: Array, layout: FeatureLayout) -> Float[Array, "c points"]:
    """The polygon on the other side of the face; the frame's first point is at its top."""
    around = len(layout.template_frame)
    mirror = np.append(layout.mirror, len(layout.names) + (-np.arange(around)) % around)
    return polygon[:, mirror]
