"""The texture of an expression: what its photos show over the texture of the neutral head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, Shaped, UInt8
from mien.camera import Camera
from mien.mesh import Mesh
from mien.numeric.images.hole_filling import fill_pyramid
from mien.texture.atlas import fill_gutters
from mien.texture.blend import Blend, blend_views
from mien.texture.parts import SEE_THROUGH, STYLES
from mien.texture.subject import subject_mask
from mien.texture.surface import SurfaceMap, over_vertices, parts_of
from mien.texture.visibility import View, feather, prepare_view

FEATHER_MM = 0.7
"""What is seen through a slit would be lost in a wider one."""
_FADE = (0.05, 0.2)
"""Cosines between which colours fade out: steeper than where photos compete, for this one alone
shows the expression."""
_PARTS = tuple(name for name, style in STYLES.items() if style.photos == "best")
_REACH_MM = 6.0
"""How far what is seen goes on where nothing is seen."""
_RAMP_MM, _SLIT_MM = 10.0, 12.0
_FINE_MM, _MOST_ENLARGED = 0.5, 4
_ENOUGH = 2000
"""Texels that both show for their exposures to be compared."""
_MOST_GAIN = 1.6


@dataclass(frozen=True)
class ExpressionLook:
    """What the photos of an expression show.

    Attributes:
        colours: (H, W, 3) float32, 0 to 255.
        share: (H, W) in [0, 1], how far they count.
        seen: (H, W) in [0, 1], how far the photos themselves show them.
        gains: (K, 3) what each photo's colours were multiplied by.
    """

    colours: Float[Array, "h w 3"]
    share: Float[Array, "h w"]
    seen: Float[Array, "h w"]
    gains: Float[Array, "k 3"]

    def over(self, below: Shaped[Array, "h w 3"], surface: SurfaceMap) -> UInt8[Array, "h w 3"]:
        """The texture: these colours as far as they count, over what lies below."""
        mixed = below + self.share[..., None] * (self.colours - below)
        pixels = np.clip(np.rint(mixed), 0, 255).astype(np.uint8)
        # Beyond the charts: where nothing is seen, the gutters below are as good.
        return fill_gutters(pixels, surface.mask)

    def beside(self, other: ExpressionLook) -> ExpressionLook:
        """Both, where their shares lie beside each other; where they overlap, in between."""
        total = np.maximum(self.share + other.share, 1e-6)[..., None]
        mixed = self.share[..., None] * self.colours + other.share[..., None] * other.colours
        return ExpressionLook(
            (mixed / total).astype(np.float32),
            np.minimum(self.share + other.share, 1),
            np.maximum(self.seen * (self.share > 0), other.seen * (other.share > 0)),
            np.concatenate([self.gains, other.gains]),
        )


def look_at_expression(
    mesh: Mesh,
    cameras: Sequence[Camera],
    photos: Sequence[UInt8[Array, "h w 3"]],
    *,
    surface: SurfaceMap,
    below: UInt8[Array, "h w 3"],
    within: Float[Array, " v"],
    inside: Float[Array, " v"],
) -> ExpressionLook:
    """What photos show of an expression on the head's own texture map.

    Args:
        mesh: as fitted to the photos.
        surface: its atlas_surface, (H, W).
        below: (H, W, 3) neutral's texture: exposures are matched to it.
        within: (V,) in [0, 1], where the head may look different from neutral, eyes and teeth
            included: [Pighin 2002]'s facial mask (sec. 6.1.1); hair and neck are the same for all.
        inside: (V,) in [0, 1], skin behind lips and lids.
    """
    solid = mesh.submesh(
        mesh.triangles_of(*(name for name in mesh.part_names if name not in SEE_THROUGH))
    )
    enlarged = [_enlarged(*pair) for pair in zip(cameras, photos, strict=True)]
    views = [
        prepare_view(
            solid,
            camera,
            photo,
            texel_mm=surface.texel_mm,
            subject=subject_mask(solid, camera, photo),
            # Lips and lids are fitted to this very photo, and no other shows what is between them.
            edge_mm=0.0,
            hidden_mm=0.0,
        )
        for camera, photo in enlarged
    ]
    skin = parts_of(surface, mesh, "skin")
    mask = over_vertices(surface, mesh, within[:, None])[..., 0]
    gains = _gains(surface, views, below, skin & (mask > 0.5))
    seen = blend_views(surface, views, gains, feather_mm=FEATHER_MM, fade=_FADE)
    inner = skin & (over_vertices(surface, mesh, inside[:, None])[..., 0] > 0.5)
    colours, share = np.zeros_like(seen.colours), np.zeros_like(seen.confidence)
    outer = skin & ~inner
    for texels in (outer, inner, *(parts_of(surface, mesh, name) for name in _PARTS)):
        colours[texels], share[texels] = _spread(seen, texels, _REACH_MM / surface.texel_mm)
    share[outer] *= _ramp(seen, outer, surface)[outer]
    share *= mask
    return ExpressionLook(colours, share.astype(np.float32), seen.confidence, gains)


def _enlarged(camera: Camera, photo: UInt8[Array, "h w 3"]) -> tuple[Camera, UInt8[Array, "h w 3"]]:
    """A small photo enlarged: what is seen through a slit of two pixels is seen."""
    import cv2

    pixel_mm = float(camera.t_cam_head[2]) / camera.focal_px
    factor = min(_MOST_ENLARGED, int(np.ceil(pixel_mm / _FINE_MM)))
    if factor <= 1:
        return camera, photo
    size = (camera.width * factor, camera.height * factor)
    large: Array = cv2.resize(photo, size, interpolation=cv2.INTER_CUBIC)
    return camera.resized(factor), large


def _ramp(seen: Blend, outer: Bool[Array, "h w"], surface: SurfaceMap) -> Float[Array, "h w"]:
    """(H, W) from 0 where the photos end to 1: wide, for light and exposure differ a little. At

    lips, lids and nostrils, whose surroundings are seen from all sides, they do not end.
    """
    import cv2

    size = 2 * round(_SLIT_MM / surface.texel_mm) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    shown = ((seen.confidence > 0.5) | ~outer).astype(np.uint8)
    closed = cv2.morphologyEx(shown, cv2.MORPH_CLOSE, disc)
    return feather(closed > 0, _RAMP_MM / surface.texel_mm)


def _spread(
    seen: Blend, texels: Bool[Array, "h w"], reach: float
) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
    """Colours of a part's texels, (N, 3), and how far they count, (N,): where they are seen, and

    fading with the distance from there, for what is a little aside comes into view, too.
    """
    import cv2

    rows, columns = (np.flatnonzero(texels.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    inside = texels[box]
    sure = seen.confidence[box] * inside
    if not (sure > 0.5).any():
        return seen.colours[texels], seen.confidence[texels] * 0
    filled = fill_pyramid(seen.colours[box], sure)
    away = cv2.distanceTransform((sure <= 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    share = np.maximum(sure, np.clip(2 - 2 * away / reach, 0, 1))
    return filled[inside], share[inside]


def _gains(
    surface: SurfaceMap,
    views: Sequence[View],
    below: UInt8[Array, "h w 3"],
    texels: Bool[Array, "h w"],
) -> Float[Array, "k 3"]:
    """(K, 3) factors that bring each photo to neutral's exposure and white balance."""
    gains = np.ones((len(views), 3))
    for k, view in enumerate(views):
        seen = blend_views(surface, [view], None, feather_mm=FEATHER_MM)
        both = texels & (seen.confidence > 0.9)
        if np.count_nonzero(both) < _ENOUGH:
            continue
        ratio = np.log(np.maximum(below[both], 8.0) / np.maximum(seen.colours[both], 8.0))
        gains[k] = np.clip(np.exp(np.median(ratio, axis=0)), 1 / _MOST_GAIN, _MOST_GAIN)
    return gains
