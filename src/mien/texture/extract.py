"""One texture from photos: the view-independent texture map of [Pighin 2002] sec. 5.2.2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8, check_positive
from mien.camera import Camera
from mien.errors import EstimationError, InputError
from mien.mesh import Mesh
from mien.texture.atlas import fill_gutters
from mien.texture.blend import Blend, blend_views
from mien.texture.cylinder import Cylinder, cylinder_surface, fit_cylinder
from mien.texture.equalize import estimate_gains
from mien.texture.fill import (
    FILLS,
    Fill,
    SkinFill,
    blend_over,
    build_skin_fill,
    fill_part,
    mirror_difference,
    on_cylinder,
)
from mien.texture.parts import SEE_THROUGH, SKIN, STYLES, PartStyle, fill_colour
from mien.texture.subject import subject_mask
from mien.texture.surface import SurfaceMap, cropped, mirrored, part_mask, restricted
from mien.texture.visibility import TextureView, prepare_view

# The coarse cylinder on which photos are compared and holes are filled: 1 mm or so.
_COARSE = (512, 256)


@dataclass(frozen=True)
class Texture:
    """Colours of a surface.

    Attributes:
        pixels: (H, W, 3) uint8 sRGB.
        coverage: (H, W) float32, the summed weights g_k: 0 where no photo shows the texel.
        gains: (K, 3) what each photo's colours were multiplied by.
    """

    pixels: UInt8[Array, "h w 3"]
    coverage: Float[Array, "h w"]
    gains: Float[Array, "k 3"]


@dataclass(frozen=True)
class _Job:
    """Inputs that all parts of one texture share."""

    mesh: Mesh
    views: list[TextureView]
    gains: Float[Array, "k 3"]
    feather_mm: float
    certainty_power: float
    fill: Fill
    cylinder: Cylinder
    mirror: Int[Array, " v"] | None = None
    mirror_difference: Float[Array, "h w 3"] | None = None


def extract_texture(
    mesh: Mesh,
    cameras: Sequence[Camera],
    photos: Sequence[UInt8[Array, "h w 3"]],
    *,
    surface: SurfaceMap,
    feather_mm: float = 12.0,
    certainty_power: float = 1.0,
    equalize: bool = True,
    fill: Fill = "pyramid",
    mirror: Int[Array, " v"] | None = None,
    regions: Mapping[str, Float[Array, " v"]] | None = None,
    find_subject: bool = True,
) -> Texture:
    """The colour of every texel, from the photos that see it.

    Args:
        mesh: as it was fitted to the photos.
        cameras: K, one for each photo, of its size.
        photos: K.
        surface: which texels to colour (cylinder_surface or atlas_surface of this mesh).
        feather_mm: width of the ramp at each photo's boundary, along the surface.
        certainty_power: weights are F_k P_k^power; a larger power favours the best photo.
        equalize: equalize exposure and white balance between photos.
        fill: how texels that no photo shows are filled; with "none" they are black.
        mirror: (V,) left-right partners; if given, holes take the other side's colours first.
        regions: (V,) soft masks by name (those of the generic head): hair, ears and neck are
            each filled from themselves, and the inside of the mouth is dark red.
        find_subject: segment the person in each photo; else the mesh's outline is used.

    Raises:
        InputError: counts and sizes that differ.
        EstimationError: no photo sees the mesh.

    Source:
        [Pighin 2002] sec. 5.2.1, 5.2.2. Differs: colours seen at a grazing angle fade into the
        filled surroundings; the skin's holes are filled on the cylinder for any layout, so that no
        seam shows; parts are done one by one (sec. 5.2.4).
    """
    job = _prepare(mesh, cameras, photos, surface, feather_mm, fill, find_subject)
    job = replace(job, certainty_power=certainty_power)
    job, skin_fill = _prepare_on_cylinder(job, equalize, mirror, regions or {})
    pixels = _background(surface, skin_fill)
    coverage = np.zeros(surface.triangle_ids.shape, np.float32)
    for name in mesh.part_names:
        texels = part_mask(surface, mesh, name)
        box = _box(texels, surface.wrap)
        if box is None:
            continue
        part = restricted(cropped(surface, box), texels[box])
        colours, weights = _texture_part(job, part, name, skin_fill)
        pixels[box][part.mask] = colours[part.mask]
        coverage[box][part.mask] = weights[part.mask]
    result = np.clip(np.rint(pixels), 0, 255).astype(np.uint8)
    if fill != "none" and not surface.wrap:
        result = fill_gutters(result, surface.mask)
    return Texture(result, coverage, job.gains)


def _prepare_on_cylinder(
    job: _Job,
    equalize: bool,
    mirror: Int[Array, " v"] | None,
    regions: Mapping[str, Float[Array, " v"]],
) -> tuple[_Job, SkinFill]:
    """Estimates on a coarse cylinder: gains, difference between the sides, colours for holes."""
    mesh, (width, height) = job.mesh, _COARSE
    skin = ("skin",) if "skin" in mesh.part_names else mesh.part_names
    coarse = cylinder_surface(mesh, job.cylinder, width=width, height=height, parts=skin)
    if equalize:
        job = replace(job, gains=estimate_gains(coarse, job.views, feather_mm=job.feather_mm))
    around = _blend(job, coarse, SKIN)
    if not around.coverage.any():
        raise EstimationError("no photo sees the head where its camera says it is")
    if mirror is not None:
        difference = mirror_difference(around, _blend(job, mirrored(coarse, mesh, mirror), SKIN))
        job = replace(job, mirror=mirror, mirror_difference=difference)
        around = _blend(job, coarse, SKIN)
    return job, build_skin_fill(coarse, mesh, around, job.cylinder, job.fill, regions)


def _prepare(
    mesh: Mesh,
    cameras: Sequence[Camera],
    photos: Sequence[Array],
    surface: SurfaceMap,
    feather_mm: float,
    fill: Fill,
    find_subject: bool,
) -> _Job:
    if fill not in FILLS:
        raise InputError("fill", " or ".join(FILLS), fill)
    check_positive("feather_mm", feather_mm)
    if len(cameras) != len(photos) or not cameras:
        raise InputError("photos", f"{len(cameras)} of them, one a camera", len(photos))
    names = [name for name in mesh.part_names if name not in SEE_THROUGH]
    solid = mesh.submesh(mesh.triangles_of(*names))
    views = []
    for camera, photo in zip(cameras, photos, strict=True):
        subject = subject_mask(solid, camera, photo) if find_subject else None
        views.append(prepare_view(solid, camera, photo, texel_mm=surface.texel_mm, subject=subject))
    return _Job(mesh, views, np.ones((len(views), 3)), feather_mm, 1.0, fill, fit_cylinder(mesh))


def _texture_part(
    job: _Job, surface: SurfaceMap, name: str, skin_fill: SkinFill
) -> tuple[Float[Array, "h w 3"], Float[Array, "h w"]]:
    """Colours and coverage of one part."""
    style = STYLES.get(name, SKIN)
    blend = _blend(job, surface, style)
    if job.fill == "none":
        return blend.colours, blend.coverage
    if style.fill != "surface":
        colours = fill_part(blend, fill_colour(style, blend), style.reach_mm / surface.texel_mm)
        return colours, blend.coverage
    colours = blend.colours.copy()
    holes = surface.mask & (blend.confidence < 1)
    filled = skin_fill.colours(surface, job.mesh, holes)
    share = blend.confidence[holes][:, None]
    colours[holes] = filled + share * (colours[holes] - filled)
    return colours, blend.coverage


def _blend(job: _Job, surface: SurfaceMap, style: PartStyle) -> Blend:
    """The photos on one part, over the other side's colours when there is a mirror map."""
    views, gains = job.views, job.gains
    shape = surface.triangle_ids.shape
    if style.photos == "none":
        return Blend(np.zeros((*shape, 3), np.float32), *np.zeros((2, *shape), np.float32))

    def blended(texels: SurfaceMap, chosen: list[int]) -> Blend:
        return blend_views(
            texels,
            [views[k] for k in chosen],
            gains[chosen],
            feather_mm=min(job.feather_mm, style.feather_mm),
            certainty_power=job.certainty_power,
        )

    everything = list(range(len(views)))
    if style.photos == "best":
        single = [blended(surface, [k]) for k in everything]
        single.sort(key=lambda blend: -float(blend.coverage.sum()))
        return reduce(blend_over, single)
    blend = blended(surface, everything)
    if job.mirror is None or job.mirror_difference is None:
        return blend
    other = blended(mirrored(surface, job.mesh, job.mirror), everything)
    used = (other.confidence > 0) & (blend.confidence < 1)
    shift = on_cylinder(job.mirror_difference, job.cylinder, surface.points[used])
    other.colours[used] = np.clip(other.colours[used] + shift, 0, 255)
    return blend_over(blend, other)


def _background(surface: SurfaceMap, skin_fill: SkinFill) -> Float[Array, "h w 3"]:
    """(H, W, 3) float32 colours of texels without a surface, before gutters are filled."""
    import cv2

    height, width = surface.triangle_ids.shape
    if not surface.wrap:
        return np.zeros((height, width, 3), np.float32)
    return cv2.resize(skin_fill.images[-1], (width, height), interpolation=cv2.INTER_LINEAR)


def _box(texels: Bool[Array, "h w"], wrap: bool) -> tuple[slice, slice] | None:
    """The rectangle around the texels (the whole image when it wraps), None when there are none."""
    rows, columns = np.flatnonzero(texels.any(axis=1)), np.flatnonzero(texels.any(axis=0))
    if not len(rows):
        return None
    if wrap:
        return slice(None), slice(None)
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
