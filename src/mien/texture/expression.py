"""The texture of an expression: a layer from its photos over the texture of the neutral head."""

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
from mien.texture.surface import SurfaceMap, interpolate_vertex_values, part_mask
from mien.texture.visibility import TextureView, feather, prepare_view

FEATHER_MM = 0.7
"""Narrow, so that what shows between lips or lids is kept."""
_FADE = (0.05, 0.2)
"""Cosines between which colours fade out: lower than where many photos are blended, for often one
photo alone shows the expression."""
_PARTS = tuple(name for name, style in STYLES.items() if style.photos == "best")
_REACH_MM = 6.0
"""How far visible colours are extended into texels that no photo shows."""
_RAMP_MM, _SLIT_MM = 10.0, 12.0
_FINE_MM, _MAX_ENLARGEMENT = 0.5, 4
_MIN_TEXELS = 2000
"""Texels that a photo must share with neutral for exposures to be compared."""
_MAX_GAIN = 1.6


@dataclass(frozen=True)
class TextureLayer:
    """Colours from the photos of one expression, with an opacity for each texel.

    Attributes:
        colours: (H, W, 3) float32, 0 to 255.
        opacity: (H, W) in [0, 1], weight of these colours over those below.
        confidence: (H, W) in [0, 1], how well the photos show the texel; 0 where it was filled.
        gains: (K, 3) factors that each photo's colours were multiplied by.
    """

    colours: Float[Array, "h w 3"]
    opacity: Float[Array, "h w"]
    confidence: Float[Array, "h w"]
    gains: Float[Array, "k 3"]

    def over(self, below: Shaped[Array, "h w 3"], surface: SurfaceMap) -> UInt8[Array, "h w 3"]:
        """The layer composited over the colours below, (H, W, 3)."""
        mixed = below + self.opacity[..., None] * (self.colours - below)
        pixels = np.clip(np.rint(mixed), 0, 255).astype(np.uint8)
        # Beyond the charts, where no photo shows anything, the gutters below serve as well.
        return fill_gutters(pixels, surface.mask)

    def merged_with(self, other: TextureLayer) -> TextureLayer:
        """Both layers; where they overlap, the mean weighted by opacity."""
        total = np.maximum(self.opacity + other.opacity, 1e-6)[..., None]
        mixed = self.opacity[..., None] * self.colours + other.opacity[..., None] * other.colours
        return TextureLayer(
            (mixed / total).astype(np.float32),
            np.minimum(self.opacity + other.opacity, 1),
            np.maximum(
                self.confidence * (self.opacity > 0), other.confidence * (other.opacity > 0)
            ),
            np.concatenate([self.gains, other.gains]),
        )


def extract_expression_layer(
    mesh: Mesh,
    cameras: Sequence[Camera],
    photos: Sequence[UInt8[Array, "h w 3"]],
    *,
    surface: SurfaceMap,
    below: UInt8[Array, "h w 3"],
    within: Float[Array, " v"],
    inside: Float[Array, " v"],
) -> TextureLayer:
    """The layer that photos of an expression give in the head's own texture map.

    Args:
        mesh: as fitted to the photos.
        cameras: K, one for each photo.
        photos: K.
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
            # Lips and lids are fitted to this photo, and no other shows what is between them.
            edge_mm=0.0,
            hidden_mm=0.0,
        )
        for camera, photo in enlarged
    ]
    skin = part_mask(surface, mesh, "skin")
    mask = interpolate_vertex_values(surface, mesh, within[:, None])[..., 0]
    gains = _gains(surface, views, below, skin & (mask > 0.5))
    blend = blend_views(surface, views, gains, feather_mm=FEATHER_MM, fade=_FADE)
    inner = skin & (interpolate_vertex_values(surface, mesh, inside[:, None])[..., 0] > 0.5)
    colours, opacity = np.zeros_like(blend.colours), np.zeros_like(blend.confidence)
    outer = skin & ~inner
    for texels in (outer, inner, *(part_mask(surface, mesh, name) for name in _PARTS)):
        colours[texels], opacity[texels] = _extend_colours(
            blend, texels, _REACH_MM / surface.texel_mm
        )
    opacity[outer] *= _ramp(blend, outer, surface)[outer]
    opacity *= mask
    return TextureLayer(colours, opacity.astype(np.float32), blend.confidence, gains)


def _enlarged(camera: Camera, photo: UInt8[Array, "h w 3"]) -> tuple[Camera, UInt8[Array, "h w 3"]]:
    """A small photo enlarged, so that what shows through a slit of two pixels is not lost."""
    import cv2

    pixel_mm = float(camera.t_cam_head[2]) / camera.focal_px
    factor = min(_MAX_ENLARGEMENT, int(np.ceil(pixel_mm / _FINE_MM)))
    if factor <= 1:
        return camera, photo
    size = (camera.width * factor, camera.height * factor)
    large: Array = cv2.resize(photo, size, interpolation=cv2.INTER_CUBIC)
    return camera.resized(factor), large


def _ramp(blend: Blend, outer: Bool[Array, "h w"], surface: SurfaceMap) -> Float[Array, "h w"]:
    """(H, W) opacity that rises from 0 where the photos end to 1.

    It is wide, because light and exposure differ a little. Gaps at lips, lids and nostrils do not
    count as ends.
    """
    import cv2

    size = 2 * round(_SLIT_MM / surface.texel_mm) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    shown = ((blend.confidence > 0.5) | ~outer).astype(np.uint8)
    closed = cv2.morphologyEx(shown, cv2.MORPH_CLOSE, disc)
    return feather(closed > 0, _RAMP_MM / surface.texel_mm)


def _extend_colours(
    blend: Blend, texels: Bool[Array, "h w"], reach: float
) -> tuple[Float[Array, "n 3"], Float[Array, " n"]]:
    """Colours, (N, 3), and opacities, (N,), of a part's texels.

    Colours are extended beyond the visible texels, and opacity falls with the distance: small
    differences of pose bring neighbouring texels into view.
    """
    import cv2

    rows, columns = (np.flatnonzero(texels.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    inside = texels[box]
    confidence = blend.confidence[box] * inside
    if not (confidence > 0.5).any():
        return blend.colours[texels], blend.confidence[texels] * 0
    filled = fill_pyramid(blend.colours[box], confidence)
    distance = cv2.distanceTransform((confidence <= 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    opacity = np.maximum(confidence, np.clip(2 - 2 * distance / reach, 0, 1))
    return filled[inside], opacity[inside]


def _gains(
    surface: SurfaceMap,
    views: Sequence[TextureView],
    below: UInt8[Array, "h w 3"],
    texels: Bool[Array, "h w"],
) -> Float[Array, "k 3"]:
    """(K, 3) factors that match each photo's exposure and white balance to neutral's."""
    gains = np.ones((len(views), 3))
    for k, view in enumerate(views):
        blend = blend_views(surface, [view], None, feather_mm=FEATHER_MM)
        both = texels & (blend.confidence > 0.9)
        if np.count_nonzero(both) < _MIN_TEXELS:
            continue
        ratio = np.log(np.maximum(below[both], 8.0) / np.maximum(blend.colours[both], 8.0))
        gains[k] = np.clip(np.exp(np.median(ratio, axis=0)), 1 / _MAX_GAIN, _MAX_GAIN)
    return gains
