"""The pictures of a report, as data URIs."""

from __future__ import annotations

import base64

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.head import ATLAS, Head
from mien.io.files.image import encode_image
from mien.mesh import Mesh
from mien.reconstruction.result import PhotoFit
from mien.render.orbit import orbit_camera
from mien.render.overlay import overlay_mesh
from mien.render.picture import GREY
from mien.render.shade import render

PREVIEWS = {"front": 0, "left": 45, "left side": 90, "back": 180, "right side": -90, "right": -45}
_SIDES = ("front", "left side", "back", "right side")
UNCERTAINTY_LIMITS_MM = (1.0, 10.0)
"""Uncertainties that the brightest and the darkest colour stand for."""
_DARK, _BRIGHT = np.array([60.0, 30.0, 80.0]), np.array([250.0, 220.0, 60.0])
_SIZE = (360, 450)
_PHOTO_HEIGHT = 900
_USED, _DISTRUSTED = (60, 230, 90), (240, 60, 50)

Picture = dict[str, str]


def preview_pictures(head: Head) -> list[Picture]:
    """The head from several sides."""
    return [_seen_from(head.mesh, head.textures[ATLAS], name) for name in PREVIEWS]


def coverage_pictures(head: Head, coverage: Float[Array, "h w"]) -> list[Picture]:
    """The head coloured by coverage: dark where no photo shows it, bright where seen frontally."""
    share = np.clip(coverage / max(float(np.quantile(coverage, 0.99)), 1e-6), 0, 1)[..., None]
    colours = np.rint(_DARK + share * (_BRIGHT - _DARK)).astype(np.uint8)
    return [_seen_from(head.mesh, colours, name) for name in _SIDES]


def uncertainty_pictures(head: Head) -> list[Picture]:
    """The head coloured by uncertainty: bright where it is small."""
    low, high = UNCERTAINTY_LIMITS_MM
    # Logarithmic: from half to one millimetre matters as much as from five to ten.
    share = np.log(np.clip(head.uncertainty_mm, low, high) / low) / np.log(high / low)
    colours = _BRIGHT + share[:, None] * (_DARK - _BRIGHT)
    return [_seen_from(head.mesh, None, name, vertex_colours=colours) for name in _SIDES]


def overlay_picture(mesh: Mesh, fit: PhotoFit, pixels: UInt8[Array, "h w 3"]) -> str:
    """A photo with the mesh over it and every mark, joined to where the model puts it."""
    import cv2

    factor = min(1.0, _PHOTO_HEIGHT / len(pixels))
    camera = fit.camera.resized(factor)
    size = (camera.width, camera.height)
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    image = overlay_mesh(small, mesh, camera, opacity=0.3)
    for mark in fit.marks:
        seen = mark.image_point * factor - 0.5
        model = seen + mark.residual_px * factor
        colour = _DISTRUSTED if mark.rejection else _USED
        ends = [tuple(int(x) for x in np.rint(point * 16)) for point in (seen, model)]
        cv2.line(image, ends[0], ends[1], colour, 1, cv2.LINE_AA, 4)
        cv2.circle(image, ends[0], 32 if mark.by_hand else 20, colour, -1, cv2.LINE_AA, 4)
    return data_uri(image)


def _seen_from(
    mesh: Mesh,
    texture: UInt8[Array, "h w 3"] | None,
    name: str,
    *,
    vertex_colours: Float[Array, "v 3"] | None = None,
) -> Picture:
    camera = orbit_camera(
        np.radians(PREVIEWS[name]), width=_SIZE[0], height=_SIZE[1], vertices=mesh.vertices
    )
    image = render(
        mesh,
        camera,
        texture,
        vertex_colours=vertex_colours,
        samples=4,
        background=GREY,
    )
    return {"source": data_uri(image[..., :3]), "caption": name}


def data_uri(image: UInt8[Array, "h w 3"]) -> str:
    """The picture as a data URI, for the source of an <img>."""
    encoded = base64.b64encode(encode_image(image, "JPEG", quality=88)).decode()
    return f"data:image/jpeg;base64,{encoded}"
