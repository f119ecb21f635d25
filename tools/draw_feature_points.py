"""Draws the picture of docs' feature points: python -m tools.draw_feature_points PHOTO.

Left: points and triangles. Right: the subregions with their blend weights. PHOTO shows an
open mouth.
"""

from __future__ import annotations

import colorsys
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from mien.arrays import Array, Float
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.subregions import default_subregions
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import load_photo

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "feature-points.jpg"
_HEIGHT = 700
_MARGIN = 0.3
_OPACITY = 0.5


def main(path: str) -> None:
    """Write the picture."""
    layout, photo = load_feature_layout(), load_photo(path)
    with LandmarkDetector() as detector:
        points = layout.from_landmarks(detector.detect(photo).points)
    margin = _MARGIN * np.ptp(points[:, 0])
    low = np.maximum(points.min(axis=0) - margin, 0)
    high = np.minimum(points.max(axis=0) + margin, photo.pixels.shape[1::-1])
    factor = _HEIGHT / (high - low)[1]
    size = (int((high - low)[0] * factor), _HEIGHT)
    picture = Image.fromarray(photo.pixels).resize(
        size, Image.Resampling.BICUBIC, box=(*low.tolist(), *high.tolist())
    )
    points = (points - low) * factor
    both = [_points(picture, layout, points), _subregions(picture, layout, points)]
    Image.fromarray(np.hstack(both)).save(PICTURE, quality=85, optimize=True)


def _points(picture: Image.Image, layout: FeatureLayout, points: Float[Array, "n 2"]) -> Array:
    drawn = picture.copy()
    draw = ImageDraw.Draw(drawn)
    for triangle in layout.triangles[(layout.triangles < len(points)).all(axis=1)]:
        corners = [tuple(points[i]) for i in (*triangle, triangle[0])]
        draw.line(corners, fill=(120, 200, 255))
    for x, y in points:
        draw.ellipse([x - 2.5, y - 2.5, x + 2.5, y + 2.5], fill=(230, 0, 0))
    return np.asarray(drawn)


def _subregions(picture: Image.Image, layout: FeatureLayout, points: Float[Array, "n 2"]) -> Array:
    subregions = default_subregions(layout, points, picture.size)
    count = len(subregions.names)
    # Neighbours in the list get hues far apart.
    hues = [(index * 5 % count) / count for index in range(count)]
    colours = 255 * np.array([colorsys.hsv_to_rgb(hue, 0.85, 1.0) for hue in hues])
    on_face = _OPACITY * subregions.fades.sum(axis=2, keepdims=True)
    mixed = np.asarray(picture) * (1 - on_face) + _OPACITY * (subregions.fades @ colours)
    return np.clip(mixed, 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main(sys.argv[1])
