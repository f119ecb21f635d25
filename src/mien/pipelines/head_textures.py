"""Textures of a fitted head from its photos: an atlas for every expression, and a cylinder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.head import CYLINDER, NEUTRAL, FittedView, Head
from mien.progress import StepProgress
from mien.rig.expression_textures import ExpressionPhotos, extract_expression_textures
from mien.texture.atlas import atlas_surface
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.extract import Texture, extract_texture
from mien.texture.fill import Fill
from mien.texture.surface import SurfaceMap

Photos = Mapping[str, UInt8[Array, "h w 3"]]


def texture_head(
    head: Head, photos: Photos, *, size: int, fill: Fill, progress: StepProgress
) -> tuple[Head, Float[Array, "h w"]]:
    """The head with an atlas for every expression and neutral's cylinder.

    Args:
        head: without textures.
        photos: pixels, by name; those of the head's views.
        size: side of the atlas in px.
        fill: how texture that no photo shows is filled.
        progress: called with steps done and their total.

    Returns:
        The head, and the summed weights of the photos in the neutral atlas.

    Source:
        [Pighin 2002] sec. 5.2.2.
    """
    total = 3
    progress(0, total)
    base = _extract(head, photos, atlas_surface(head.mesh, width=size, height=size), fill)
    progress(1, total)
    photographed = {
        name: ExpressionPhotos(
            item.vertices,
            [view.camera for view in item.views],
            [photos[view.photo] for view in item.views],
        )
        for name, item in head.expressions.items()
    }
    painted = extract_expression_textures(head.mesh, photographed, base.pixels, load_generic_head())
    progress(2, total)
    around = cylinder_surface(head.mesh, fit_cylinder(head.mesh), parts=("skin",))
    cylinder = _extract(head, photos, around, fill)
    progress(3, total)
    textures = {head.expressions[name].texture: pixels for name, pixels in painted.textures.items()}
    textures[CYLINDER] = cylinder.pixels
    gains = painted.gains | {NEUTRAL: base.gains}
    expressions = {
        name: replace(item, views=_with_gains(item.views, gains[name]))
        for name, item in head.expressions.items()
    }
    head = replace(head, expressions=expressions, textures=textures, shading=painted.shading)
    return head, base.coverage


def _with_gains(views: Sequence[FittedView], gains: Float[Array, "k 3"]) -> tuple[FittedView, ...]:
    return tuple(replace(view, gains=own) for view, own in zip(views, gains, strict=True))


def _extract(head: Head, photos: Photos, surface: SurfaceMap, fill: Fill) -> Texture:
    """Neutral's."""
    generic = load_generic_head()
    views = head.expressions[NEUTRAL].views
    return extract_texture(
        head.expression_mesh(NEUTRAL),
        [view.camera for view in views],
        [photos[view.photo] for view in views],
        surface=surface,
        fill=fill,
        mirror=generic.mirror,
        regions=generic.regions,
    )
