"""Pictures of a posed face whose textures are blended ([Pighin 2002] sec. 6.1, eq. 5)."""

from __future__ import annotations

from collections.abc import Sequence

from mien.arrays import Array, UInt8
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.render.mipmap import build_pyramids
from mien.render.multitexture import draw_multitextured, prepare_textured_mesh
from mien.render.projection import samples_across
from mien.render.shade import over_background, shown_parts
from mien.rig.state import PosedFace


class MorphRenderer:
    """Draws posed faces of one head; what does not depend on the pose is prepared once.

    Args:
        mesh: the head's topology, texture coordinates and parts; its vertices do not matter.
        textures: of one size, in the mesh's own texture coordinates.
        parts: names of the parts to show; by default those that pictures show.

    Raises:
        InputError: a mesh without texture coordinates, unknown parts, no textures, sizes that
            differ.
    """

    def __init__(
        self,
        mesh: Mesh,
        textures: Sequence[UInt8[Array, "h w 3"]],
        *,
        parts: tuple[str, ...] | None = None,
    ) -> None:
        shown = mesh.submesh(mesh.triangles_of(*(shown_parts(mesh) if parts is None else parts)))
        self._mesh = prepare_textured_mesh(shown, build_pyramids(textures))
        self._shape = (len(mesh.vertices), len(textures))

    def render(
        self,
        face: PosedFace,
        camera: Camera,
        *,
        samples: int = 4,
        background: tuple[int, int, int] | UInt8[Array, "h w 3"] | None = None,
    ) -> UInt8[Array, "h w 4"]:
        """(H, W, 4) uint8 sRGB with straight alpha, as the camera sees the face.

        Every pixel blends the textures by weights interpolated from the vertices, times the
        brightness; only the result is clamped.

        Args:
            face: with weights of the renderer's textures.
            camera: of the picture.
            samples: per pixel, 1, 4 or 9: more make smooth edges; within a triangle the textures
                are looked up once a pixel.
            background: a colour or an image; alpha is then 255 everywhere.

        Raises:
            InputError: another number of vertices or textures than the renderer's, a background of
                another size than the camera's.
        """
        factor = samples_across(samples)
        if face.weights.shape != self._shape:
            found = f"shape {face.weights.shape}"
            raise InputError("face", f"weights of shape {self._shape}", found)
        weights, brightness = face.weights, face.brightness
        image = draw_multitextured(self._mesh, face.vertices, weights, brightness, camera, factor)
        return image if background is None else over_background(image, background)
