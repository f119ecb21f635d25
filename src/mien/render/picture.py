"""A picture of a head as a user asks for it."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.errors import InputError
from mien.model.head import ATLAS, Head
from mien.render.orbit import orbit_camera, turntable
from mien.render.shade import render


def render_head(
    head: Head,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    size: tuple[int, int] = (800, 1000),
    photo: str | None = None,
    units: Mapping[str, float] | None = None,
    background: tuple[int, int, int] | None = None,
) -> UInt8[Array, "h w 4"]:
    """The textured head, RGBA.

    Args:
        yaw, pitch, roll: radians, as docs/conventions.md says.
        size: width and height in px; with `photo`, the photo's own.
        photo: reproduce the camera of this photo instead of turning the head.
        units: weights of face units by name; 0 to 1 is their usual range.
        background: sRGB; transparent unless given.
    Raises: InputError: no such photo or unit.
    """
    mesh = head.mesh.with_vertices(with_units(head, units or {}))
    if photo is not None:
        camera = head.view(photo).camera
    else:
        width, height = size
        # Framed by the neutral head, so that an open mouth does not change the scale.
        camera = orbit_camera(
            -yaw, pitch, roll, width=width, height=height, vertices=head.mesh.vertices
        )
    return render(mesh, camera, head.textures[ATLAS], samples=4, background=background)


def with_units(head: Head, units: Mapping[str, float]) -> Float[Array, "v 3"]:
    """(V, 3) mm: the neutral shape with face units added. Raises: InputError: no such unit."""
    vertices = np.array(head.mesh.vertices)
    for name, weight in units.items():
        if name not in head.unit_names:
            close = difflib.get_close_matches(name, head.unit_names, n=3)
            expected = "a face unit" + (f" such as {', '.join(close)}" if close else "")
            raise InputError("unit", expected, name)
        vertices += weight * head.units[head.unit_names.index(name)]
    return vertices


def turntable_frames(
    head: Head,
    *,
    frames: int = 72,
    size: tuple[int, int] = (400, 500),
    background: tuple[int, int, int] = (72, 74, 84),
) -> Iterator[UInt8[Array, "h w 3"]]:
    """The head once around, one picture at a time."""
    width, height = size
    for camera in turntable(frames, width=width, height=height, vertices=head.mesh.vertices):
        picture = render(head.mesh, camera, head.textures[ATLAS], samples=4, background=background)
        yield picture[..., :3]
