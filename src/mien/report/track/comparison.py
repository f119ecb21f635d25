"""The tracked face as the video's camera sees it, and how like the frame it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8, check_image
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.render.picture import HeadRenderer
from mien.render.shade import rasterize_mesh, shown_parts
from mien.track.state import Track, TrackedFrame

_BORDER = 0.03
"""Width over which a drawn face gives way to the frame, as a share of the face's own size."""
_REGIONS = ("face", "eye_socket", "mouth_cavity")
_PARTS = ("left_eyeball", "right_eyeball", "upper_teeth", "lower_teeth", "tongue")


@dataclass(frozen=True)
class DrawnFace:
    """The head as it was found in a frame.

    Attributes:
        picture: (h, w, 4) sRGB with straight alpha, in the frame's own colours.
        inside: (h, w) where it shows the face: what face_pixels gives, but for its outline, where
            the frame has something else in its pixels.
    """

    picture: UInt8[Array, "h w 4"]
    inside: Bool[Array, "h w"]

    def over(self, pixels: UInt8[Array, "h w 3"]) -> UInt8[Array, "h w 3"]:
        """The frame with the face, and nothing else of the head, drawn over it; softly bordered.

        Raises:
            InputError: a frame of another size than the picture.
        """
        import cv2

        frame = np.ascontiguousarray(_check_size("pixels", pixels, self.inside))
        share = _softened(self.inside)
        colours = np.ascontiguousarray(self.picture[..., :3])
        return cv2.blendLinear(colours, frame, share, 1 - share)


def draw_tracked(
    renderer: HeadRenderer, track: Track, found: TrackedFrame, camera: Camera | None = None
) -> DrawnFace | None:
    """The head as it was found in a frame; None where it was lost.

    Args:
        track: that the frame is of.
        camera: of a part of the frame or of another size; by default the track's own.

    Raises:
        InputError: an expression or unit that the head does not have.
    """
    if found.state is None:
        return None
    camera = camera or track.camera(found.state)
    face = renderer.rig.evaluate(found.state.face(track.layout))
    drawn = _matched(renderer.draw_posed(face, camera), found)
    inside = face_pixels(renderer.head.mesh.with_vertices(face.vertices), camera)
    return DrawnFace(drawn, inside & (drawn[..., 3] == 255))


def face_psnr(
    pixels: UInt8[Array, "h w 3"], drawn: UInt8[Array, "h w c"], mask: Bool[Array, "h w"]
) -> float:
    """How near a drawing comes to a frame over a mask, dB; NaN over an empty one.

    Args:
        drawn: (h, w, 3), or (h, w, 4) of which alpha does not count.
        mask: such as DrawnFace.inside without what covers the face.

    Raises:
        InputError: sizes that differ.
    """
    frame, other = _check_size("pixels", pixels, mask), _check_size("drawn", drawn[..., :3], mask)
    if not mask.any():
        return float("nan")
    squared = (frame[mask].astype(np.float64) - other[mask]) ** 2
    return float(10 * np.log10(255**2 / max(float(squared.mean()), 1e-2)))


def face_pixels(mesh: Mesh, camera: Camera) -> Bool[Array, "h w"]:
    """Where the camera sees the face: not the rest of the skin, but eyes, teeth and tongue.

    Args:
        mesh: of the generic head's topology.
    """
    shown = mesh.triangles_of(*shown_parts(mesh))
    ids = rasterize_mesh(mesh.submesh(shown), camera).triangle_ids
    return _face_triangles()[shown][ids] & (ids >= 0)


@cache
def _face_triangles() -> Bool[Array, " f"]:
    generic = load_generic_head()
    of_face = np.maximum.reduce([generic.regions[name] for name in _REGIONS])
    inside: Array = of_face[generic.mesh.triangles].mean(axis=1) > 0.5
    inside[generic.mesh.triangles_of(*_PARTS)] = True
    return inside


def _matched(drawn: UInt8[Array, "h w 4"], found: TrackedFrame) -> UInt8[Array, "h w 4"]:
    """The picture in the frame's colours."""
    import cv2

    levels = np.arange(256.0)[:, None]
    colours = np.clip(np.rint(levels * found.gain + found.bias), 0, 255)
    table = np.concatenate([colours, levels], axis=1).astype(np.uint8)
    return cv2.LUT(drawn, table[None])


def _softened(inside: Bool[Array, "h w"]) -> Float[Array, "h w"]:
    """(h, w) float32: 0 at the mask's border and outside, 1 a little further in."""
    import cv2

    mask = inside.astype(np.float32)
    sigma = max(0.5, _BORDER * float(np.sqrt(mask.sum())))
    across = 2 * round(sigma) + 1
    for _ in range(2):
        mask = cv2.blur(mask, (across, across))
    return np.clip(2 * mask - 1, 0, 1) * inside


def _check_size(name: str, image: object, mask: Bool[Array, "h w"]) -> UInt8[Array, "h w 3"]:
    checked = check_image(name, image)
    if checked.shape[:2] != mask.shape:
        expected = f"{mask.shape[1]}x{mask.shape[0]} px"
        raise InputError(name, expected, f"{checked.shape[1]}x{checked.shape[0]}")
    return checked
