"""A picture of where a head is off a scan."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.scan import FACE_RADIUS_MM, Scan, move
from mien.arrays import Array, Float, UInt8
from mien.camera import Camera
from mien.mesh import Mesh
from mien.render.orbit import orbit_camera
from mien.render.shade import Light, render

LARGEST_MM = 4.0
"""Where the colours end."""
YAWS = (-40, 0, 40)
SIZE = (240, 280)
UNMEASURED = (150.0, 150.0, 150.0)
# Even light, so that shading tells the form and hardly changes the colours.
LIGHT = Light(key_strength=0.35, fill_strength=0.1, ambient=0.62)


def save_error_map(
    path: Path,
    mesh: Mesh,
    heads: Mapping[str, tuple[Float[Array, "v 3"], Float[Array, "4 4"]]],
    scan: Scan,
    *,
    near: Float[Array, "n 3"],
) -> None:
    """One row of three views for every head, coloured by the distance to the scan, and the scan.

    Args:
        mesh: topology.
        heads: vertices, (V, 3) mm in head space, and where they lie on the scan, by caption.
        near: (N, 3) mm, attachments of the landmarks on the first head: what is measured.
    """
    import matplotlib.pyplot as plt
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    (first, T_scan_head), *_ = heads.values()
    measured = cKDTree(near).query(first)[0] < FACE_RADIUS_MM
    scale = ScalarMappable(Normalize(0, LARGEST_MM), "turbo")
    cameras = [_camera(yaw, first[measured]) for yaw in YAWS]
    rows = {"the scan": [_clay(scan, T_scan_head, camera) for camera in cameras]}
    for caption, (vertices, T) in heads.items():
        distances = scan.nearest(move(T, vertices))[1]
        colours = np.where(measured[:, None], 255 * scale.to_rgba(distances)[:, :3], UNMEASURED)
        shape = mesh.with_vertices(vertices)
        rows[caption] = [_coloured(shape, colours, camera) for camera in cameras]
    width, height = SIZE[0] * len(YAWS) / 100, SIZE[1] * len(rows) / 100
    figure, grid = plt.subplots(len(rows), len(YAWS), figsize=(width + 0.9, height), squeeze=False)
    for axes, (caption, pictures) in zip(grid, rows.items(), strict=True):
        for axis, picture in zip(axes, pictures, strict=True):
            axis.imshow(picture)
            axis.set_axis_off()
        axes[1].set_title(caption, fontsize=10, y=0.99)
    right = width / (width + 0.9)
    figure.subplots_adjust(0, 0, right, 0.97, 0, 0.09)
    bar = figure.colorbar(scale, cax=figure.add_axes((right, 0.2, 0.02, 0.3)), extend="max")
    bar.set_label("mm to the scan")
    _save_small(figure, path)
    plt.close(figure)


def _camera(yaw: float, measured: Float[Array, "n 3"]) -> Camera:
    return orbit_camera(
        np.radians(yaw), width=2 * SIZE[0], height=2 * SIZE[1], vertices=measured, margin=0.02
    )


def _clay(scan: Scan, T_scan_head: Float[Array, "4 4"], camera: Camera) -> UInt8[Array, "h w 3"]:
    """The scan where the first head is."""
    vertices = move(np.linalg.inv(T_scan_head), np.array(scan.surface.vertices))
    shape = Mesh(vertices, np.array(scan.surface.faces, np.int32))
    return render(shape, camera, samples=4, background=(255, 255, 255))[..., :3]


def _coloured(shape: Mesh, colours: Float[Array, "v 3"], camera: Camera) -> UInt8[Array, "h w 3"]:
    picture = render(
        shape,
        camera,
        vertex_colours=colours,
        samples=4,
        light=LIGHT,
        background=(255, 255, 255),
    )
    return picture[..., :3]


def _save_small(figure: object, path: Path) -> None:
    """With a palette, which such a picture does not notice."""
    from PIL import Image

    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)  # type: ignore[attr-defined]
    picture = Image.open(stream).convert("RGB").quantize(256, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)
