"""The tracked head drawn as the video's camera sees it, and its PSNR against the frame."""

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
"""Width over which a drawn face is blended into the frame, as a share of the face's size."""
_REGIONS = ("face", "eye_socket", "mouth_cavity")
_PARTS = ("left_eyeball", "right_eyeball", "upper_teeth", "lower_teeth", "tongue")


@dataclass(frozen=True)
class DrawnHead:
    """The head drawn as it was tracked in a frame.

    Attributes:
        picture: (h, w, 4) sRGB with straight alpha, in the frame's own colours.
        mask: (h, w) where it shows the face: face_mask without the pixels of its outline, which
            are not fully covered.
    """

    picture: UInt8[Array, "h w 4"]
    mask: Bool[Array, "h w"]

    def blended_over(self, pixels: UInt8[Array, "h w 3"]) -> UInt8[Array, "h w 3"]:
        """The frame with the face, without the rest of the head, blended over it.

        Args:
            pixels: (h, w, 3) sRGB of the frame.

        Raises:
            InputError: a frame of another size than the picture.
        """
        import cv2

        frame = np.ascontiguousarray(_check_size("pixels", pixels, self.mask))
        share = _feathered(self.mask)
        colours = np.ascontiguousarray(self.picture[..., :3])
        return cv2.blendLinear(colours, frame, share, 1 - share)


def draw_tracked_head(
    renderer: HeadRenderer, track: Track, frame: TrackedFrame, camera: Camera | None = None
) -> DrawnHead | None:
    """The head drawn as it was tracked in a frame; None where it was lost.

    Args:
        renderer: of the head.
        track: that the frame is of.
        frame: of the track.
        camera: of a part of the frame or of another size; by default the track's own.

    Raises:
        InputError: an expression or unit that the head does not have.
    """
    if frame.state is None:
        return None
    camera = camera or track.camera(frame.state)
    face = renderer.rig.evaluate(frame.state.face(track.layout))
    drawn = _in_frame_colours(renderer.draw_posed(face, camera), frame)
    mask = face_mask(renderer.head.mesh.with_vertices(face.vertices), camera)
    return DrawnHead(drawn, mask & (drawn[..., 3] == 255))


def face_psnr(
    pixels: UInt8[Array, "h w 3"], drawn: UInt8[Array, "h w c"], mask: Bool[Array, "h w"]
) -> float:
    """PSNR of a drawing against a frame over a mask, dB; NaN over an empty one.

    Args:
        pixels: (h, w, 3) sRGB of the frame.
        drawn: (h, w, 3), or (h, w, 4) of which alpha does not count.
        mask: (h, w) as DrawnHead.mask, less what occludes the face.

    Raises:
        InputError: sizes that differ.
    """
    frame, other = _check_size("pixels", pixels, mask), _check_size("drawn", drawn[..., :3], mask)
    if not mask.any():
        return float("nan")
    squared = (frame[mask].astype(np.float64) - other[mask]) ** 2
    return float(10 * np.log10(255**2 / max(float(squared.mean()), 1e-2)))


def face_mask(mesh: Mesh, camera: Camera) -> Bool[Array, "h w"]:
    """(h, w) where the camera sees the face with eyes, teeth and tongue, without the other skin.

    Args:
        mesh: of the generic head's topology.
        camera: that sees it.
    """
    shown = mesh.triangles_of(*shown_parts(mesh))
    ids = rasterize_mesh(mesh.submesh(shown), camera).triangle_ids
    return _face_triangles()[shown][ids] & (ids >= 0)


@cache
def _face_triangles() -> Bool[Array, " f"]:
    generic = load_generic_head()
    of_face = np.maximum.reduce([generic.regions[name] for name in _REGIONS])
    mask: Array = of_face[generic.mesh.triangles].mean(axis=1) > 0.5
    mask[generic.mesh.triangles_of(*_PARTS)] = True
    return mask


def _in_frame_colours(drawn: UInt8[Array, "h w 4"], frame: TrackedFrame) -> UInt8[Array, "h w 4"]:
    """The picture with the frame's gain and bias of colours."""
    import cv2

    levels = np.arange(256.0)[:, None]
    colours = np.clip(np.rint(levels * frame.gain + frame.bias), 0, 255)
    table = np.concatenate([colours, levels], axis=1).astype(np.uint8)
    return cv2.LUT(drawn, table[None])


def _feathered(mask: Bool[Array, "h w"]) -> Float[Array, "h w"]:
    """(h, w) float32: 0 at the mask's border and outside, 1 a little further in."""
    import cv2

    weight = mask.astype(np.float32)
    sigma = max(0.5, _BORDER * float(np.sqrt(weight.sum())))
    across = 2 * round(sigma) + 1
    for _ in range(2):
        weight = cv2.blur(weight, (across, across))
    return np.clip(2 * weight - 1, 0, 1) * mask


def _check_size(name: str, image: object, mask: Bool[Array, "h w"]) -> UInt8[Array, "h w 3"]:
    checked = check_image(name, image)
    if checked.shape[:2] != mask.shape:
        expected = f"{mask.shape[1]}x{mask.shape[0]} px"
        raise InputError(name, expected, f"{checked.shape[1]}x{checked.shape[0]}")
    return checked
