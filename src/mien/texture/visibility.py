"""Visibility of texels in photos: depth test, positional certainty, feathering."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8, check_image, check_positive, frozen
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.images.sampling import bilinear_neighbours
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.numeric.raster.rasterizer import rasterize
from mien.texture.surface import SurfaceMap

# Two neighbouring pixels of the depth map that differ by more lie on different layers. One pixel
# is a fraction of a millimetre wide: no surface that could be textured is so steep.
_JUMP_MM = 3.0
_MAX_SLOPE = 4.0
# Cosine: a surface seen at a more grazing angle (80 degrees) is not used.
MIN_CERTAINTY = 0.17


@dataclass(frozen=True)
class TextureView:
    """A photo prepared for sampling.

    Attributes:
        camera: of the photo as it is here (perhaps smaller than the original).
        photo: (H, W, 3) uint8.
        depth: (H, W) float32 mm, of the nearest surface that hides others; infinite beside it.
        usable: (H, W) bool: pixels that reliably show the head: not the background, and not so near
            to an outline that a small error of the shape would change what they show.
    """

    camera: Camera
    photo: UInt8[Array, "h w 3"]
    depth: Float[Array, "h w"]
    usable: Bool[Array, "h w"]


@dataclass(frozen=True)
class Visibility:
    """Visibility of a surface's texels in one view.

    Attributes:
        feathered: (H, W) float32, F_k: 1 where the texel is visible, ramped to 0 at the boundary.
        certainty: (H, W) float32, P_k: cosine between normal and direction to the camera.
    """

    feathered: Float[Array, "h w"]
    certainty: Float[Array, "h w"]


def prepare_view(
    mesh: Mesh,
    camera: Camera,
    photo: UInt8[Array, "h w 3"],
    *,
    texel_mm: float = 0.0,
    subject: Bool[Array, "h w"] | None = None,
    outline_mm: float = 3.0,
    edge_mm: float = 1.0,
    hidden_mm: float = 3.0,
) -> TextureView:
    """The photo with its depth map (the Z-buffer of [Pighin 2002] sec. 5.2.1).

    Args:
        mesh: everything that occludes.
        camera: of the photo.
        photo: (H, W, 3) uint8.
        texel_mm: the photo is halved while its pixels are much finer than this.
        subject: pixels that show the person; all when None.
        outline_mm: how far from the mesh's outline in the photo a pixel has to be to be used.
        edge_mm: how far from an edge inside the outline, where one layer hides another.
        hidden_mm: how far from such an edge on the side of the layer behind.

    Raises:
        InputError: no image, a camera of another size.
    """
    photo = check_image("photo", photo)
    if photo.shape[:2] != (camera.height, camera.width):
        expected = f"{camera.width}x{camera.height} px as its camera says"
        raise InputError("photo", expected, f"{photo.shape[1]}x{photo.shape[0]}")
    in_camera = camera.to_camera(mesh.vertices)
    pixel_mm = float(np.median(in_camera[:, 2])) / camera.focal_px
    while texel_mm > 1.5 * pixel_mm and min(photo.shape[:2]) > 256:
        camera, photo, pixel_mm = _halved_camera(camera), _halved(photo), 2 * pixel_mm
        subject = None if subject is None else subject[1::2, 1::2]
    pixels = camera.project(mesh.vertices)
    raster = rasterize(pixels, in_camera[:, 2], mesh.triangles, camera.width, camera.height)
    usable = _reliable_pixels(raster.depth, pixel_mm, outline_mm, edge_mm, hidden_mm)
    if subject is not None:
        usable &= subject[: camera.height, : camera.width]
    return TextureView(camera, photo, raster.depth, usable)


def surface_visibility(
    surface: SurfaceMap,
    view: TextureView,
    *,
    feather_mm: float = 12.0,
    tolerance_mm: float = 1.5,
    min_certainty: float = MIN_CERTAINTY,
) -> Visibility:
    """Feathered visibility F_k and positional certainty P_k of a surface in one view.

    Args:
        surface: the texels.
        view: the photo.
        feather_mm: width of the ramp from invisible to fully visible, along the surface.
        tolerance_mm: how far behind the depth map a visible point can lie; on a steep surface the
            change of its depth within a pixel is added.
        min_certainty: cosine below which a texel counts as turned away.

    Source:
        [Pighin 2002] sec. 5.2.1 and 5.2.2, steps 1 and 2. A texel is visible when it is inside the
        photo, faces the camera, lies on the depth map and falls on a usable pixel.
    """
    check_positive("tolerance_mm", tolerance_mm)
    height, width = surface.triangle_ids.shape
    visible = np.zeros((height, width), np.uint8)
    certainty = np.zeros((height, width), np.float32)
    arrays = (surface.points, surface.normals, surface.triangle_ids, view.depth, view.usable)
    inputs = [frozen(np.ascontiguousarray(array)) for array in arrays]
    pose = camera_parameters(view.camera)

    def rows(first: int, end: int) -> None:
        _visibility_rows(*inputs, pose, tolerance_mm, min_certainty, first, end, visible, certainty)

    for_row_bands(rows, height, work=width * height)
    # A chart's edge does not count as a boundary of visibility.
    unoccluded = (visible > 0) | (surface.triangle_ids < 0)
    feathered = feather(unoccluded, feather_mm / surface.texel_mm, wrap=surface.wrap)
    feathered[surface.triangle_ids < 0] = 0
    return Visibility(feathered, certainty)


def feather(
    visible: Bool[Array, "h w"], width: float, *, wrap: bool = False
) -> Float[Array, "h w"]:
    """1 inside, 0 outside, and between them the cubic 3 t^2 - 2 t^3 over `width` pixels inwards.

    Args:
        visible: (H, W).
        width: px.
        wrap: left and right ends touch.

    Source:
        [Pighin 2002] sec. 5.2.2, step 1.
    """
    import cv2

    if width <= 0:
        return visible.astype(np.float32)
    margin = min(int(np.ceil(width)) + 1, visible.shape[1]) if wrap else 0
    padded = np.pad(visible, ((0, 0), (margin, margin)), mode="wrap").astype(np.uint8)
    ramp: Array = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    ramp = ramp[:, margin : margin + visible.shape[1]]
    # The nearest invisible pixel's centre is 1 away from a pixel at the boundary.
    for_row_bands(lambda a, b: _ramp_rows(ramp, width, a, b), len(ramp), work=ramp.size)
    return ramp


def camera_parameters(camera: Camera) -> Float[Array, " 18"]:
    """Rotation, translation, focal length, principal point and centre, for the kernels."""
    parts = (
        camera.R_cam_head.ravel(),
        camera.t_cam_head,
        [camera.focal_px, *camera.principal],
        camera.center,
    )
    return frozen(np.concatenate(parts))


def _halved(photo: Array) -> Array:
    import cv2

    height, width = photo.shape[0] // 2, photo.shape[1] // 2
    return cv2.resize(
        photo[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA
    )


def _halved_camera(camera: Camera) -> Camera:
    return replace(
        camera,
        width=camera.width // 2,
        height=camera.height // 2,
        focal_px=camera.focal_px / 2,
        principal_px=camera.principal / 2,
    )


def _reliable_pixels(
    depth: Array, pixel_mm: float, outline_mm: float, edge_mm: float, hidden_mm: float
) -> Bool[Array, "h w"]:
    """Pixels that a small error of the shape does not change.

    Args:
        depth: (H, W) mm.
        pixel_mm: size of a pixel at the head.
        outline_mm: from the mesh's outline.
        edge_mm: from an edge inside it, on either side.
        hidden_mm: from such an edge on the side of what is hidden: there another layer's colours
            would land on a surface far behind it.
    """
    import cv2

    inside = np.isfinite(depth)
    layers = np.where(inside, depth, np.float32(1e9))
    edges = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(layers, axis=axis)) > _JUMP_MM
        ahead, behind = [slice(None)] * 2, [slice(None)] * 2
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        edges[tuple(ahead)] |= jump
        edges[tuple(behind)] |= jump
    reliable = _distance(inside) > outline_mm / pixel_mm
    reliable &= _distance(~(edges & inside)) > edge_mm / pixel_mm
    reach = round(hidden_mm / pixel_mm)
    if reach > 0:
        nearest = cv2.erode(layers, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
        # A steep surface alone gains this much within the reach.
        reliable &= layers - nearest <= _JUMP_MM + _MAX_SLOPE * hidden_mm
    return reliable


def _distance(mask: Bool[Array, "h w"]) -> Float[Array, "h w"]:
    """Distance to the nearest pixel outside the mask; the photo's border does not count."""
    import cv2

    return cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)


@njit(cache=True, nogil=True)
def _ramp_rows(distance: Array, width: float, first: int, end: int) -> None:
    """Distances to their ramp, in place."""
    for row in range(first, end):
        for col in range(distance.shape[1]):
            t = min(max((distance[row, col] - 0.5) / width, 0.0), 1.0)
            distance[row, col] = t * t * (3.0 - 2.0 * t)


@njit(cache=True, nogil=True)
def project_point(pose: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Pixel and depth of a point; pose as given by camera_parameters."""
    depth = pose[6] * x + pose[7] * y + pose[8] * z + pose[11]
    scale = pose[12] / depth
    column = scale * (pose[0] * x + pose[1] * y + pose[2] * z + pose[9]) + pose[13]
    row = scale * (pose[3] * x + pose[4] * y + pose[5] * z + pose[10]) + pose[14]
    return column, row, depth


@njit(cache=True, nogil=True)
def _is_shown(depth_map: Array, usable: Array, x: float, y: float, nearest: float) -> bool:
    """Whether all four pixels that a lookup reads are usable and none shows anything nearer."""
    height, width = depth_map.shape
    x0, x1, y0, y1, _, _ = bilinear_neighbours(x, y, width, height)
    for row in (y0, y1):
        for col in (x0, x1):
            if not usable[row, col] or depth_map[row, col] < nearest:
                return False
    return True


@njit(cache=True, nogil=True)
def _visibility_rows(
    points: Array,
    normals: Array,
    ids: Array,
    depth_map: Array,
    usable: Array,
    pose: Array,
    tolerance: float,
    least: float,
    first: int,
    end: int,
    visible: Array,
    certainty: Array,
) -> None:
    height, width = depth_map.shape
    for row in range(first, end):
        for col in range(ids.shape[1]):
            if ids[row, col] < 0:
                continue
            x, y, z = points[row, col]
            dx, dy, dz = pose[15] - x, pose[16] - y, pose[17] - z
            away = np.sqrt(dx * dx + dy * dy + dz * dz)
            nx, ny, nz = normals[row, col]
            cosine = (nx * dx + ny * dy + nz * dz) / away
            certainty[row, col] = max(cosine, 0.0)
            if cosine < least:
                continue
            px, py, depth = project_point(pose, x, y, z)
            if not (depth > 0.0 and 0.0 <= px < width and 0.0 <= py < height):
                continue
            # Within a pixel the depth changes by its width times the tangent of the tilt.
            slope = np.sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine
            nearest = depth - tolerance - slope * depth / pose[12]
            visible[row, col] = _is_shown(depth_map, usable, px, py, nearest)
