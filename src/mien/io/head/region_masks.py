"""Region masks as grey pictures in the layout of the texture, which can be painted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.io.files.image import encode_image, load_image
from mien.mesh import Mesh
from mien.rig.regions import MASK_NAMES
from mien.texture.atlas import atlas_surface, fill_gutters
from mien.texture.surface import interpolate_vertex_values

FOLDER = "regions"
MASK_FILES = frozenset(f"{FOLDER}/{name}.png" for name in MASK_NAMES)
"""Within a head folder; meant to be painted."""
_SIDE = 1024


def save_masks(folder: Path, mesh: Mesh, masks: dict[str, Float[Array, " v"]]) -> None:
    """`regions/NAME.png` for each mask, (V,) in [0, 1]: white where the region is."""
    if not masks:
        return
    surface = atlas_surface(mesh, width=_SIDE, height=_SIDE)
    values = interpolate_vertex_values(surface, mesh, np.stack(list(masks.values()), axis=1))
    values = fill_gutters(values, surface.mask)
    (folder / FOLDER).mkdir()
    for name, image in zip(masks, np.moveaxis(values, -1, 0), strict=True):
        grey = np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)
        picture = np.repeat(grey[..., None], 3, axis=2)
        (folder / FOLDER / f"{name}.png").write_bytes(encode_image(picture, "PNG"))


def load_masks(folder: Path, mesh: Mesh) -> dict[str, Float[Array, " v"]]:
    """The masks in a head folder, (V,) in [0, 1]; those whose file is missing are left out.

    Pictures may have any size, but must have the texture's layout.

    Raises:
        FileFormatError: a file that is no picture.
    """
    files = {name: folder / FOLDER / f"{name}.png" for name in MASK_NAMES}
    return {
        name: _at_vertices(mesh, load_image(file)) for name, file in files.items() if file.exists()
    }


def _at_vertices(mesh: Mesh, picture: UInt8[Array, "h w 3"]) -> Float[Array, " v"]:
    """The picture's brightness where the vertices lie in it, averaged over seams."""
    import cv2

    height, width = picture.shape[:2]
    pixels = mesh.uvs * [width, -height] + [-0.5, height - 0.5]
    grey = picture.mean(axis=2).astype(np.float32) / 255
    x, y = np.ascontiguousarray(pixels.astype(np.float32).T)
    sampled = cv2.remap(grey, x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[
        0
    ]
    corners, values = mesh.triangles.ravel(), sampled[mesh.uv_triangles.ravel()]
    count = np.maximum(np.bincount(corners, minlength=len(mesh.vertices)), 1)
    return np.bincount(corners, values, minlength=len(mesh.vertices)) / count
