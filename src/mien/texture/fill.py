"""Holes in the texture: filled from the other side of the face, then from the surroundings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mien.arrays import Array, Bool, Float, check_array
from mien.mesh import Mesh
from mien.numeric.images.hole_filling import fill_growing, fill_pyramid
from mien.numeric.images.sampling import sample_bilinear
from mien.texture.blend import Blend
from mien.texture.cylinder import Cylinder
from mien.texture.parts import EARS, FILLED_ALONE, REGION_COLOURS
from mien.texture.surface import SurfaceMap, interpolate_vertex_values

Fill = Literal["pyramid", "grow", "none"]
FILLS: tuple[Fill, ...] = ("pyramid", "grow", "none")

# A region is filled from itself when the photos show this many of its coarse texels (1 cm^2).
_MIN_TEXELS = 80


def fill_image(blend: Blend, fill: Fill, *, wrap: bool) -> Float[Array, "h w 3"]:
    """The colours with their holes filled, (H, W, 3) float32; uncertain ones are blended in."""
    if fill == "none":
        return blend.colours
    if fill == "grow":
        grown = fill_growing(blend.colours, blend.confidence > 0.5, wrap=wrap)
        return alpha_composite(blend.colours, grown, blend.confidence)
    return fill_pyramid(blend.colours, blend.confidence, wrap=wrap)


def alpha_composite(
    colours: Float[Array, "h w 3"], below: Float[Array, "*c"], confidence: Float[Array, "h w"]
) -> Float[Array, "h w 3"]:
    """Colours over an image or one colour, with their confidence as opacity."""
    mixed: Array = below + confidence[..., None] * (colours - below)
    return mixed.astype(np.float32)


def fill_part(blend: Blend, colour: Float[Array, " 3"], reach: float) -> Float[Array, "h w 3"]:
    """A part's holes filled with one colour, (H, W, 3) float32.

    Args:
        blend: the photos' colours.
        colour: 0 to 255.
        reach: texels over which the photos' colours give way to this one; with 0 it only replaces
            what is uncertain.
    """
    mixed = alpha_composite(blend.colours, colour, blend.confidence)
    if reach <= 1:
        return mixed
    # With so little confidence the colour only counts in blocks of the pyramid that are wider
    # than twice the reach.
    return fill_pyramid(mixed, np.maximum(blend.confidence, 0.25 / reach**2))


def blend_over(blend: Blend, below: Blend) -> Blend:
    """One blend composited over another, with its confidence as opacity."""
    share = (1 - blend.confidence) * below.confidence
    confidence = blend.confidence + share
    upper = (blend.confidence / np.maximum(confidence, 1e-12))[..., None]
    colours = below.colours + upper * (blend.colours - below.colours)
    return Blend(colours.astype(np.float32), blend.coverage, confidence.astype(np.float32))


@dataclass(frozen=True)
class SkinFill:
    """Colours of the skin where no photo shows it.

    Made on a coarse cylinder, which has no seams: a fill that is smooth there is smooth across
    every seam between charts of whatever layout.

    Attributes:
        cylinder: around the head.
        images: (R, H, W, 3) float32, for each region its colours continued over the cylinder.
        masks: (R, V) weight of each region at each vertex; they sum to 1.
    """

    cylinder: Cylinder
    images: Float[Array, "r h w 3"]
    masks: Float[Array, "r v"]

    def colours(
        self, surface: SurfaceMap, mesh: Mesh, texels: Bool[Array, "h w"]
    ) -> Float[Array, "n 3"]:
        """(N, 3) float32 of chosen texels."""
        points = surface.points[texels]
        shares = interpolate_vertex_values(surface, mesh, self.masks.T)[texels]
        total = np.zeros((len(points), 3), np.float32)
        for image, share in zip(self.images, shares.T, strict=True):
            inside = share > 1e-3
            sampled = on_cylinder(image, self.cylinder, points[inside])
            total[inside] += share[inside, None] * sampled
        return total


def on_cylinder(
    image: Float[Array, "h w 3"], cylinder: Cylinder, points: Float[Array, "n 3"]
) -> Float[Array, "n 3"]:
    """Colours of an image on the cylinder at points in head space (mm)."""
    height, width = image.shape[:2]
    uvs = cylinder.uvs(points.astype(np.float64))
    # One column more at either end, so that lookups go around.
    padded = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
    places = np.column_stack([uvs[:, 0] * width + 1, (1 - uvs[:, 1]) * height])
    return sample_bilinear(padded, places)


def mirror_difference(blend: Blend, other: Blend) -> Float[Array, "h w 3"]:
    """What to add to the other side's colours so that they join those of the photos.

    Args:
        blend: the photos on the coarse cylinder.
        other: their mirror image there.

    Returns:
        (H, W, 3) float32: the difference where both are known, smoothed over 10 mm or so and
        continued over the rest; light is seldom the same on both sides.
    """
    import cv2

    both = np.minimum(blend.confidence, other.confidence)
    if not both.any():
        return np.zeros(blend.colours.shape, np.float32)
    difference = (blend.colours - other.colours) * both[..., None]
    weight = cv2.GaussianBlur(both, (0, 0), 4)
    smooth = cv2.GaussianBlur(difference, (0, 0), 4) / np.maximum(weight, 1e-6)[..., None]
    return fill_pyramid(smooth, both, wrap=True)


def build_skin_fill(
    coarse: SurfaceMap,
    mesh: Mesh,
    blend: Blend,
    cylinder: Cylinder,
    fill: Fill,
    regions: Mapping[str, Float[Array, " v"]],
) -> SkinFill:
    """The holes of the skin filled region by region: hair from hair, ears from ears.

    Args:
        coarse: the skin on the cylinder.
        mesh: of the head.
        blend: the photos on the coarse cylinder.
        cylinder: of the coarse surface.
        fill: how holes are filled.
        regions: (V,) soft masks by name; the rest of the skin is filled from itself too. A region
            of which the photos show next to nothing belongs to the rest; an ear that they do not
            show is filled from the skin.

    Raises:
        InputError: a mask that does not fit the mesh.
    """
    left = np.ones(len(mesh.vertices))
    regions = _with_hair(mesh, regions)
    images, masks = [], []
    for name, colour in REGION_COLOURS.items():
        if name in regions:
            masks.append(np.minimum(check_array(name, regions[name], left.shape), left))
            images.append(np.tile(np.array(colour, np.float32), (*coarse.triangle_ids.shape, 1)))
            left = left - masks[-1]
    ears, scalp = (_union(regions, names, left.shape) for names in (EARS, ("scalp",)))
    for name in FILLED_ALONE:
        if name in regions:
            mask = np.minimum(check_array(name, regions[name], left.shape), left)
            own = _within(blend, coarse, mesh, mask)
            if own.confidence.sum() < _MIN_TEXELS and name in EARS:
                own = _within(blend, coarse, mesh, 1 - np.maximum(scalp, ears))
            if own.confidence.sum() < _MIN_TEXELS:
                continue
            masks.append(mask)
            images.append(fill_image(own, fill, wrap=True))
            left = left - mask
    rest = _within(blend, coarse, mesh, left)
    if rest.confidence.sum() < _MIN_TEXELS:
        rest = _within(blend, coarse, mesh, 1 - ears)
    images.append(fill_image(rest if rest.confidence.any() else blend, fill, wrap=True))
    return SkinFill(cylinder, np.stack(images), np.stack([*masks, left]))


def _with_hair(
    mesh: Mesh, regions: Mapping[str, Float[Array, " v"]]
) -> Mapping[str, Float[Array, " v"]]:
    """The hair cap has the scalp's colours."""
    if "hair" not in mesh.part_names or "scalp" not in regions:
        return regions
    scalp = check_array("scalp", regions["scalp"], (len(mesh.vertices),)).copy()
    scalp[mesh.triangles[mesh.triangles_of("hair")]] = 1
    return {**regions, "scalp": scalp}


def _union(
    regions: Mapping[str, Float[Array, " v"]], names: tuple[str, ...], shape: tuple[int, ...]
) -> Float[Array, " v"]:
    masks = [check_array(name, regions[name], shape) for name in names if name in regions]
    return np.max([np.zeros(shape), *masks], axis=0)


def _within(blend: Blend, surface: SurfaceMap, mesh: Mesh, mask: Float[Array, " v"]) -> Blend:
    """The blend without confidence outside a region and on its soft border."""
    inside = interpolate_vertex_values(surface, mesh, mask[:, None])[..., 0] > 0.9
    return replace(blend, confidence=blend.confidence * inside)
