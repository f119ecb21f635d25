"""Pictures of a head as a user asks for them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from mien.arrays import Array, UInt8
from mien.camera import Camera
from mien.errors import InputError
from mien.head import Head
from mien.limits import MAX_SIDE
from mien.render.morph import MorphRenderer
from mien.render.orbit import orbit_camera, turntable_cameras
from mien.rig.rig import Rig
from mien.rig.state import FACE, FaceState, PosedFace

GREY = (72, 74, 84)
"""Behind a head where a picture is to have no alpha."""


class HeadRenderer:
    """Draws one head in any state; what does not depend on the state is prepared once.

    Attributes:
        head: the head.
        rig: poses its face; made from the head unless given.

    Raises:
        InputError: as Rig.
    """

    def __init__(self, head: Head, *, rig: Rig | None = None) -> None:
        self.head, self.rig = head, rig or Rig(head)

    @cached_property
    def _renderer(self) -> MorphRenderer:
        return MorphRenderer(self.head.mesh, self.rig.textures)

    def camera(
        self,
        yaw: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        *,
        size: tuple[int, int] = (800, 1000),
    ) -> Camera:
        """The camera that sees the head turned like this (radians, docs/reference/conventions.md).

        Framed by the neutral head, so that an open mouth does not change the scale.
        """
        width, height = size
        vertices = self.head.mesh.vertices
        return orbit_camera(-yaw, pitch, roll, width=width, height=height, vertices=vertices)

    def draw(
        self,
        state: FaceState,
        camera: Camera,
        *,
        background: tuple[int, int, int] | UInt8[Array, "h w 3"] | None = None,
    ) -> UInt8[Array, "h w 4"]:
        """(H, W, 4) sRGB with straight alpha.

        Args:
            state: expressions, units and gaze.
            camera: of the picture.
            background: a colour or an image; transparent unless given.

        Raises:
            InputError: an unknown region, expression or unit, weights out of range.
        """
        return self.draw_posed(self.rig.evaluate(state), camera, background=background)

    def draw_posed(
        self,
        face: PosedFace,
        camera: Camera,
        *,
        background: tuple[int, int, int] | UInt8[Array, "h w 3"] | None = None,
    ) -> UInt8[Array, "h w 4"]:
        """As draw, of a face that the rig has posed."""
        return self._renderer.render(face, camera, samples=4, background=background)


def render_head(
    head: Head | HeadRenderer,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    size: tuple[int, int] = (800, 1000),
    photo: str | None = None,
    state: FaceState | None = None,
    background: tuple[int, int, int] | None = None,
) -> UInt8[Array, "h w 4"]:
    """A picture of the textured head, (H, W, 4) sRGB with alpha.

    Args:
        head: the head, or a HeadRenderer of it, which is faster for many pictures.
        yaw: radians (docs/reference/conventions.md).
        pitch: radians.
        roll: radians.
        size: width and height in px; with `photo`, the photo's own.
        photo: use the camera of this photo instead of the angles, and its expression unless the
            state has expressions.
        state: of the face; neutral by default.
        background: sRGB; transparent unless given.

    Raises:
        InputError: no such photo, region, expression or unit; weights outside [-0.5, 1.5]; a
            picture of more than MAX_SIDE px a side.
    """
    renderer = head if isinstance(head, HeadRenderer) else HeadRenderer(head)
    state = state or FaceState()
    if photo is None:
        camera = renderer.camera(yaw, pitch, roll, size=size)
    else:
        camera = renderer.head.view(photo).camera
        if not state.expressions:
            shown = {FACE: {_expression_of(renderer.head, photo): 1.0}}
            state = replace(state, expressions=shown)
    if max(camera.width, camera.height) > MAX_SIDE:
        found = f"{camera.width}x{camera.height}"
        raise InputError(photo or "size", f"at most {MAX_SIDE} px a side", found)
    return renderer.draw(state, camera, background=background)


def turntable_frames(
    head: Head,
    *,
    frames: int = 72,
    size: tuple[int, int] = (400, 500),
    background: tuple[int, int, int] = GREY,
) -> Iterator[UInt8[Array, "h w 3"]]:
    """The head once around, one picture at a time.

    Args:
        head: to be drawn.
        frames: number of pictures.
        size: width and height in px.
        background: sRGB.
    """
    renderer, (width, height) = HeadRenderer(head), size
    for camera in turntable_cameras(
        frames, width=width, height=height, vertices=head.mesh.vertices
    ):
        picture = renderer.draw(FaceState(), camera, background=background)
        yield np.ascontiguousarray(picture[..., :3])


def _expression_of(head: Head, photo: str) -> str:
    """The expression that a fitted photo belongs to."""
    return next(
        name
        for name, expression in head.expressions.items()
        if any(view.photo == photo for view in expression.views)
    )
