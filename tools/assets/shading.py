"""Plain shaded pictures of a mesh, good enough for a face detector to find the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.camera import Camera
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import Raster, interpolate, rasterize

_PUPIL_MM, _IRIS_MM = 2.2, 5.9
_IRIS, _SCLERA = (0.32, 0.22, 0.14), (0.88, 0.86, 0.84)
_SKIN, _LIPS, _HAIR = (0.80, 0.62, 0.54), (0.66, 0.36, 0.35), (0.22, 0.15, 0.11)


@dataclass(frozen=True)
class Lighting:
    """How a picture is lit.

    Attributes:
        light: direction towards the light in camera space (x right, y down, z forward).
        ambient: share of the light that comes from everywhere.
        brightness: factor on all colours.
    """

    light: tuple[float, float, float] = (0.35, -0.5, -1.0)
    ambient: float = 0.3
    brightness: float = 1.0


@dataclass(frozen=True)
class Paint:
    """What the head is coloured with.

    Attributes:
        colours: (V, 3) sRGB, 0 to 1.
        off_axis: (V,) mm from the axis of the eye; large on all other parts.
    """

    colours: Float[Array, "v 3"]
    off_axis: Float[Array, " v"]


def paint_head(mesh: Mesh, lips: Float[Array, " v"], brows: Float[Array, " v"]) -> Paint:
    """Colours of a plain head: skin, red lips, dark brows and hair, white eyes with an iris."""
    colours = np.tile(np.array(_SKIN), (len(mesh.vertices), 1))
    for mask, colour in ((lips, _LIPS), (brows, _HAIR)):
        colours += mask[:, None] * (np.array(colour) - colours)
    off_axis = np.full(len(mesh.vertices), 99.0)
    for part, colour in (("hair", _HAIR), ("lashes", _HAIR), ("upper_teeth", _SCLERA)):
        colours[mesh.vertices_of(part)] = colour
    for part in ("left_eyeball", "right_eyeball"):
        eye = mesh.vertices_of(part)
        centre = mesh.vertices[eye].mean(0)
        colours[eye] = _SCLERA
        off_axis[eye] = np.linalg.norm((mesh.vertices[eye] - centre)[:, :2], axis=1)
        off_axis[eye[mesh.vertices[eye, 2] < centre[2]]] = 99.0
    return Paint(colours, off_axis)


def camera_at(yaw: float, pitch: float = 0.0, *, size: int = 700, distance: float = 900) -> Camera:
    """A camera that looks at the middle of the face.

    Args:
        yaw: degrees that the camera goes around towards the subject's left.
        pitch: degrees upwards.
        size: px, width and height.
        distance: mm.
    """
    a, b = np.radians(yaw), np.radians(pitch)
    backward = np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    rotation = np.stack([right, -np.cross(backward, right), -backward])
    centre = np.array([0.0, -25.0, -40.0]) + distance * backward
    return Camera(size, size, size * distance / 330, rotation, -rotation @ centre)


def rasterize_mesh(mesh: Mesh, camera: Camera) -> Raster:
    """What the camera sees of the mesh."""
    in_camera = camera.to_camera(mesh.vertices)
    return rasterize(
        camera.project(mesh.vertices), in_camera[:, 2], mesh.triangles, camera.width, camera.height
    )


def shade(mesh: Mesh, camera: Camera, paint: Paint, lighting: Lighting) -> UInt8[Array, "h w 3"]:
    """A picture of the mesh, matt, on grey."""
    raster = rasterize_mesh(mesh, camera)
    normals = interpolate(raster, mesh.triangles, mesh.vertex_normals() @ camera.R_cam_head.T)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-9)
    light = np.array(lighting.light) / np.linalg.norm(lighting.light)
    lit = lighting.ambient + (1 - lighting.ambient) * np.clip(normals @ light, 0, 1)
    attributes = interpolate(
        raster, mesh.triangles, np.column_stack([paint.colours, paint.off_axis])
    )
    image, off_axis = attributes[..., :3], attributes[..., 3:]
    image = np.where(off_axis < _IRIS_MM, np.array(_IRIS), image)
    image = np.where(off_axis < _PUPIL_MM, 0.03, image)
    image = np.where(raster.mask[:, :, None], image * lit[:, :, None] * lighting.brightness, 0.55)
    return (255 * np.clip(image, 0, 1)).astype(np.uint8)
