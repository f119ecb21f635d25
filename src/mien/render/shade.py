"""Images of a head: textured, in vertex colours or plainly shaded, with alpha."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, UInt8, check_array, frozen
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.numeric.raster.rasterizer import Raster, interpolate, rasterize
from mien.render.mipmap import build_pyramids
from mien.render.multitexture import draw_multitextured, prepare_textured_mesh
from mien.render.projection import project_safely, samples_across


@dataclass(frozen=True)
class Light:
    """Diffuse light on an untextured head: a key light, a weaker fill light and ambient light.

    Attributes:
        key: (3,) direction towards the light in camera space (x right, y down, z forward).
        fill: as `key`.
        key_strength: the sum of the three strengths is the highest brightness of a surface.
        fill_strength: as `key_strength`.
        ambient: as `key_strength`.
    """

    key: tuple[float, float, float] = (-0.5, -0.6, -1.0)
    fill: tuple[float, float, float] = (0.8, 0.1, -0.6)
    key_strength: float = 0.6
    fill_strength: float = 0.2
    ambient: float = 0.2


# Colour of modelling clay; a face detector finds a face in it, too.
CLAY = (205.0, 172.0, 152.0)


def render(
    mesh: Mesh,
    camera: Camera,
    texture: UInt8[Array, "h w 3"] | None = None,
    *,
    vertex_colours: Float[Array, "v 3"] | None = None,
    parts: tuple[str, ...] | None = None,
    samples: int = 1,
    light: Light | None = None,
    background: tuple[int, int, int] | UInt8[Array, "h w 3"] | None = None,
) -> UInt8[Array, "h w 4"]:
    """(H, W, 4) uint8 sRGB with straight alpha, as the camera sees the mesh.

    Args:
        mesh: to be drawn.
        camera: of the picture.
        texture: by the mesh's texture coordinates; filtered where it is minified.
        vertex_colours: (V, 3) from 0 to 255 instead; with neither, the colour is that of clay.
        parts: names of the parts to show; by default all but the hair cap and the lashes.
        samples: per pixel, 1, 4 or 9: more make smooth edges.
        light: shades the head; by default only a head of clay is shaded, since photographed colours
            contain light already.
        background: a colour or an image; alpha is then 255 everywhere.

    Raises:
        InputError: shapes, a texture on a mesh without texture coordinates, unknown parts.
    """
    factor = samples_across(samples)
    if texture is not None and vertex_colours is not None:
        raise InputError("vertex_colours", "only one of them and texture", "both")
    shown = mesh.submesh(mesh.triangles_of(*(shown_parts(mesh) if parts is None else parts)))
    if texture is not None:
        image = _textured(shown, camera, texture, light, factor)
    else:
        image = _coloured(shown, camera, vertex_colours, light, factor)
    return image if background is None else over_background(image, background)


def _textured(
    mesh: Mesh, camera: Camera, texture: Array, light: Light | None, factor: int
) -> UInt8[Array, "h w 4"]:
    count = len(mesh.vertices)
    brightness = np.ones(count)
    if light is not None:
        brightness = _brightness(mesh.vertex_normals() @ camera.R_cam_head.T, light)
    surface = prepare_textured_mesh(mesh, build_pyramids([texture]))
    return draw_multitextured(
        surface, mesh.vertices, np.ones((count, 1)), brightness, camera, factor
    )


def _coloured(
    mesh: Mesh, camera: Camera, vertex_colours: Array | None, light: Light | None, factor: int
) -> UInt8[Array, "h w 4"]:
    raster = rasterize_mesh(mesh, camera.resized(factor))
    if vertex_colours is not None:
        values = check_array("vertex_colours", vertex_colours, (len(mesh.vertices), 3))
        colours = interpolate(raster, mesh.triangles, values)
    else:
        colours = np.broadcast_to(np.array(CLAY, np.float32), (*raster.depth.shape, 3))
        light = light or Light()
    if light is not None:
        normals = mesh.vertex_normals() @ camera.R_cam_head.T
        normals = interpolate(raster, mesh.triangles, normals)
        colours = colours * _brightness(normals, light)[..., None]
    return _reduced(colours, raster.mask, factor)


def shown_parts(mesh: Mesh) -> tuple[str, ...]:
    """The parts that pictures show by default: all but the hair cap and the opaque lashes."""
    return tuple(name for name in mesh.part_names if name not in ("hair", "lashes"))


def rasterize_mesh(mesh: Mesh, camera: Camera, *, cull: bool = False) -> Raster:
    """The mesh as the camera sees it (`rasterize` in the camera's pixels)."""
    depth, pixels = camera.to_camera(mesh.vertices)[:, 2], project_safely(mesh.vertices, camera)
    return rasterize(pixels, depth, mesh.triangles, camera.width, camera.height, cull=cull)


def over_background(
    image: UInt8[Array, "h w 4"], background: tuple[int, int, int] | UInt8[Array, "h w 3"]
) -> UInt8[Array, "h w 4"]:
    """The image over a colour or another image, opaque.

    Raises:
        InputError: sizes that differ.
    """
    below = np.asarray(background)
    if below.shape not in ((3,), (*image.shape[:2], 3)):
        expected = f"a colour or an image of {image.shape[1]}x{image.shape[0]} px"
        raise InputError("background", expected, f"shape {below.shape}")
    height, width = image.shape[:2]
    below = frozen(np.broadcast_to(below, (height, width, 3)))
    above, mixed = frozen(np.ascontiguousarray(image)), np.empty((height, width, 4), np.uint8)
    for_row_bands(lambda a, b: _mix_rows(above, below, a, b, mixed), height, work=width * height)
    return mixed


@njit(cache=True, nogil=True)
def _mix_rows(above: Array, below: Array, first: int, end: int, mixed: Array) -> None:
    for row in range(first, end):
        for col in range(above.shape[1]):
            alpha = np.float32(above[row, col, 3]) / np.float32(255)
            for c in range(3):
                back = np.float32(below[row, col, c])
                mixed[row, col, c] = np.rint(back + alpha * (above[row, col, c] - back))
            mixed[row, col, 3] = 255


def _brightness(normals: Float[Array, "*n 3"], light: Light) -> Float[Array, "*n"]:
    """Lambertian shading from normals in camera space; back faces are lit like front faces."""
    normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-6)
    normals = normals * np.where(normals[..., 2:] > 0, -1, 1)
    brightness = np.full(normals.shape[:-1], light.ambient, np.float32)
    for direction, strength in ((light.key, light.key_strength), (light.fill, light.fill_strength)):
        towards = np.asarray(direction, np.float32)
        towards /= np.linalg.norm(towards)
        brightness += np.float32(strength) * np.maximum(normals @ towards, 0)
    return brightness


def _reduced(colours: Array, mask: Array, factor: int) -> UInt8[Array, "h w 4"]:
    """Means over factor x factor pixels; colours are those of the head alone."""
    import cv2

    size = (mask.shape[1] // factor, mask.shape[0] // factor)
    covered = mask.astype(np.float32)
    inside = np.ascontiguousarray(colours, np.float32) * covered[..., None]
    if factor > 1:
        covered = cv2.resize(covered, size, interpolation=cv2.INTER_AREA)
        inside = cv2.resize(inside, size, interpolation=cv2.INTER_AREA)
        inside /= np.maximum(covered, 0.5 / factor**2)[..., None]
    image = np.empty((size[1], size[0], 4), np.float32)
    image[..., :3], image[..., 3] = inside, covered * 255
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)
