"""Segmentation of the person in a photo."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, UInt8, check_image
from mien.camera import Camera
from mien.capture.person_mask import find_person
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import rasterize

# Longest side of the small image that is segmented, px.
_SIDE = 240
# Space around the mesh that is segmented with it, as a share of its size.
_BORDER = 0.2
# The square in which a person is looked for, over the mesh's larger side.
_SQUARE = 1.35
# Of the mesh's inner pixels: where the network takes so few for a person, it knows nothing.
_RECOGNIZED = 0.8
# Width of the strip on both sides of the mesh's outline in which the cut may run, as a share of
# the head's size in the photo.
_STRIP = 0.06


def subject_mask(
    mesh: Mesh, camera: Camera, photo: UInt8[Array, "h w 3"], *, min_contrast: float = 12.0
) -> Bool[Array, "h w"]:
    """Pixels that show the person rather than the background, around the mesh.

    A network says where the person is (capture.person_mask). What it does not take for one, a
    drawing perhaps, is cut out by its colours, initialized with the projected mesh: pixels well
    inside its outline are foreground, pixels well outside are background, and the cut decides in
    the strip between. Where the colours on both sides are alike (dark hair before a dark wall), the
    mesh's outline is kept.

    Args:
        mesh: of the head, without parts that one can see through.
        camera: of the photo.
        photo: (H, W, 3).
        min_contrast: least difference between the colours of the two sides (Euclidean, 8-bit) for
            the cut to be used there.
    """
    import cv2

    photo = check_image("photo", photo)
    outline = _outline(mesh, camera)
    if outline is None:
        return np.zeros(photo.shape[:2], bool)
    left, top, right, bottom = outline
    found = _recognized(mesh, camera, photo, outline)
    if found is not None:
        return found
    scale = min(1.0, _SIDE / max(right - left, bottom - top))
    size = (max(1, round((right - left) * scale)), max(1, round((bottom - top) * scale)))
    small = cv2.resize(photo[top:bottom, left:right], size, interpolation=cv2.INTER_AREA)
    pixels = (camera.project(mesh.vertices) - [left, top]) * scale
    inside = rasterize(pixels, camera.to_camera(mesh.vertices)[:, 2], mesh.triangles, *size).mask
    strip = max(2.0, _STRIP * float(np.sqrt(inside.sum())))
    trusted = _contrast(small, inside, strip) > min_contrast
    mask = inside.astype(np.float32)
    if trusted.any():
        mask[trusted] = _cut(small, inside, strip)[trusted]
    person = np.zeros(photo.shape[:2], bool)
    full = cv2.resize(mask, (right - left, bottom - top), interpolation=cv2.INTER_LINEAR)
    person[top:bottom, left:right] = full > 0.5
    return person


def _recognized(
    mesh: Mesh, camera: Camera, photo: Array, outline: tuple[int, int, int, int]
) -> Bool[Array, "h w"] | None:
    """What the network takes for a person; None where that has little to do with the mesh."""
    left, top, right, bottom = outline
    side = _SQUARE * max(right - left, bottom - top) / (1 + 2 * _BORDER)
    person = find_person(photo, np.array([left + right, top + bottom]) / 2, side)
    facing = (mesh.vertex_normals() * (camera.center - mesh.vertices)).sum(axis=1) > 0
    seen = camera.project(mesh.vertices[facing])
    within = ((seen > 0) & (seen < [camera.width, camera.height])).all(axis=1)
    if not within.any() or np.mean(person.at(seen[within]) > 0.5) < _RECOGNIZED:
        return None
    return person.of_photo(camera.width, camera.height)


def _outline(mesh: Mesh, camera: Camera) -> tuple[int, int, int, int] | None:
    """Left, top, right, bottom (px) around mesh and border; None if they are not in the photo."""
    used = np.unique(mesh.triangles)
    in_camera = camera.to_camera(mesh.vertices[used])
    if not (in_camera[:, 2] > 0).all():
        return None
    pixels = camera.project(mesh.vertices[used])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    space = _BORDER * float((high - low).max())
    left, top = (max(0, int(edge - space)) for edge in low)
    right, bottom = (
        min(limit, int(np.ceil(edge + space)))
        for edge, limit in zip(high, (camera.width, camera.height), strict=True)
    )
    return (left, top, right, bottom) if right - left > 8 and bottom - top > 8 else None


def _cut(image: Array, inside: Array, strip: float) -> Bool[Array, "h w"]:
    import cv2

    deep = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, 5)
    outer = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, 5)
    labels = np.where(inside, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[deep > strip] = cv2.GC_FGD
    # Hair stands further off the mesh than anything else does, and belongs to the person.
    labels[outer > 3 * strip] = cv2.GC_BGD
    if not ((labels == cv2.GC_FGD).any() and (labels == cv2.GC_BGD).any()):
        return inside
    cv2.setRNGSeed(0)
    models = np.zeros((2, 1, 65))
    bgr = np.ascontiguousarray(image[..., ::-1])
    cv2.grabCut(bgr, labels, None, models[0], models[1], 3, cv2.GC_INIT_WITH_MASK)
    return (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)


def _contrast(image: Array, inside: Array, strip: float) -> Array:
    """(H, W) difference of the mean colours inside and outside the outline around each pixel.

    0 where only one of them is near.
    """
    import cv2

    deep = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, 5)
    outer = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, 5)
    sigma = 2 * strip
    means, near = [], np.ones(inside.shape, bool)
    for side in (deep > strip / 2, outer > strip):
        weight = cv2.GaussianBlur(side.astype(np.float32), (0, 0), sigma)
        sums = cv2.GaussianBlur(image.astype(np.float32) * side[..., None], (0, 0), sigma)
        means.append(sums / np.maximum(weight, 1e-4)[..., None])
        near &= weight > 0.02
    return np.linalg.norm(means[0] - means[1], axis=2) * near
