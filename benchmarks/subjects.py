"""Heads whose shape and colours are known at every point: what benchmarks.rendered photographs.

A colour belongs to a point of the surface and to nothing else: no light moves with the camera, no
blend depends on it. So photos of a subject agree about every point that they share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.paint import Paint, ProjectedPaint, Projector, TexturePaint
from benchmarks.scan import DATA, load_scan, scan_mesh
from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.capture.images.photos import load_photo
from mien.head import ATLAS
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import interpolate
from mien.pipelines.build import BuildOptions, build_head
from mien.render.shade import rasterize_mesh, shown_parts

__all__ = ["Subject", "emily", "james", "person", "person_vertices", "projector", "smooth_field"]

DEMO = Path(__file__).parents[1] / "src" / "mien" / "assets" / "data" / "james"


@dataclass(frozen=True)
class Subject:
    """Somebody to be photographed.

    Attributes:
        mesh: what is seen, mm, in the subject's own frame.
        paint: its colours.
        target: (3,) mm, what cameras look at: the middle of what a portrait shows.
        R_subject_portrait: (3, 3) from a frame whose z leaves the face and whose y goes up.
        height_mm: what a portrait shows from its lower to its upper edge.
        vertices: (V, 3) mm of mien's own head, of which mesh shows some triangles; None for scans.
    """

    mesh: Mesh
    paint: Paint
    target: Float[Array, " 3"]
    R_subject_portrait: Float[Array, "3 3"]
    height_mm: float
    vertices: Float[Array, "v 3"] | None = None

    def moved(self, offsets: Float[Array, "v 3"]) -> Subject:
        """The same colours on moved vertices: a person with another expression.

        The shading does not change, so that nothing but the shape does.
        """
        vertices = self.mesh.vertices + offsets
        return replace(self, mesh=self.mesh.with_vertices(vertices), vertices=vertices)


def james(data: Path = DATA / "james") -> Subject:
    """The scanned man, textured by his two photos through the scan's texture coordinates."""
    scan = load_scan(data)
    # The texture coordinates index the photos side by side.
    photos = [load_photo(data / f"photo_{side}.png").pixels for side in ("left", "right")]
    uvs = np.array(scan.surface.visual.uv)
    mesh = scan_mesh(scan)
    mesh = replace(mesh, uvs=uvs, uv_triangles=mesh.triangles)
    return Subject(
        mesh,
        TexturePaint(np.concatenate(photos, axis=1)),
        target=np.array([-22.0, 5.0, -50.0]),
        R_subject_portrait=np.eye(3),
        height_mm=300,
    )


# Centre and radius, mm, of the balls that fill the sockets of her scan. The data do not place her
# eyes; these fit the sockets' walls to half a millimetre, and the pupils that her renders show lie
# on them.
_EMILYS_EYES = (((-36.54, 90.0, 26.18), 15.3), ((23.77, 92.93, 22.43), 15.4))


def emily(data: Path = DATA / "emily") -> Subject:
    """The scanned woman, painted by her seven renders from their cameras."""
    scan = load_scan(data)
    mesh = _with_balls(scan_mesh(scan), _EMILYS_EYES)
    projectors = tuple(
        projector(mesh, camera, load_photo(data / "renders_mentalray" / f"{name}.jpg").pixels)
        for name, camera in scan.cameras.items()
    )
    return Subject(
        mesh,
        ProjectedPaint(projectors, shadow=np.array([40.0, 24.0, 18.0])),
        target=np.array([-12.0, 45.0, -50.0]),
        R_subject_portrait=np.eye(3),
        height_mm=290,
    )


def _with_balls(mesh: Mesh, balls: Sequence[tuple[tuple[float, float, float], float]]) -> Mesh:
    import trimesh

    vertices, triangles = [mesh.vertices], [mesh.triangles]
    for centre, radius in balls:
        ball = trimesh.creation.icosphere(subdivisions=5, radius=radius)
        triangles.append(np.asarray(ball.faces, np.int32) + sum(map(len, vertices)))
        vertices.append(np.asarray(ball.vertices) + centre)
    return Mesh(np.concatenate(vertices), np.concatenate(triangles))


def projector(
    mesh: Mesh,
    camera: Camera,
    photo: UInt8[Array, "h w 3"],
    *,
    power: float = 6.0,
    feather_mm: float = 12.0,
    jump_mm: float = 4.0,
) -> Projector:
    """A photo whose say falls with the slant of the surface and towards its outlines."""
    import cv2

    raster = rasterize_mesh(mesh, camera)
    towards = camera.center - mesh.vertices
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    facing = (towards * mesh.vertex_normals()).sum(axis=1, keepdims=True)
    cosine = interpolate(raster, mesh.triangles, facing)[..., 0]
    depth = np.where(raster.mask, raster.depth, np.float32(1e6))
    kernel = np.ones((3, 3), np.uint8)
    smooth = cv2.dilate(depth, kernel) - cv2.erode(depth, kernel) < jump_mm
    from_edge = cv2.distanceTransform(smooth.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    pixel_mm = float(np.median(raster.depth[raster.mask])) / camera.focal_px
    ramp = np.clip(from_edge * pixel_mm / feather_mm, 0, 1)
    weight = ramp**2 * (3 - 2 * ramp) * np.maximum(cosine, 0) ** power
    return Projector(camera, photo, depth[..., None], weight[..., None].astype(np.float32))


def person(seed: int, texture_source: Path = DEMO) -> Subject:
    """Somebody who never lived, in the skin of the person in some photos.

    Shading by a fixed light from above and one side is painted on.
    """
    vertices = person_vertices(seed)
    mesh = load_generic_head().mesh.with_vertices(vertices)
    built = build_head(texture_source, options=BuildOptions(texture_size=4096)).head
    return Subject(
        mesh.submesh(mesh.triangles_of(*shown_parts(mesh))),
        TexturePaint(built.textures[ATLAS], _shading(mesh)),
        target=np.array([0.0, -8.0, -60.0]),
        R_subject_portrait=np.eye(3),
        height_mm=290,
        vertices=vertices,
    )


def person_vertices(seed: int) -> Float[Array, "v 3"]:
    """(V, 3) mm of mien's own mesh: nobody whom the identity basis alone could describe.

    Random identity coefficients, a random asymmetric deformation (2 mm RMS, 25 mm correlation
    length) and bumps of the skin (0.3 mm RMS, 6 mm).
    """
    generic, rng = load_generic_head(), np.random.default_rng(seed)
    coefficients = rng.normal(size=len(generic.identity.components))
    vertices = generic.mesh.vertices + generic.identity.offsets(coefficients)
    vertices = _deformed(vertices, generic, rng, rms_mm=2.0, length_mm=25.0)
    return _deformed(vertices, generic, rng, rms_mm=0.3, length_mm=6.0, parts=("skin",))


def smooth_field(
    rng: np.random.Generator,
    points: Float[Array, "n 3"],
    *,
    rms_mm: float,
    length_mm: float,
    waves: int = 2000,
) -> Float[Array, "n 3"]:
    """(N, 3) mm at the points: a random field of vectors, correlated as exp(-d^2 / 2 length^2).

    Args:
        rms_mm: of the vectors' lengths over all draws.
        waves: the sum of so many random waves is nearly Gaussian.
    """
    frequencies = rng.normal(size=(waves, 3)) / length_mm
    phases = rng.uniform(0, 2 * np.pi, waves)
    amplitudes = rng.normal(size=(waves, 3)) * rms_mm * np.sqrt(2 / (3 * waves))
    return np.cos(points @ frequencies.T + phases) @ amplitudes


def _deformed(
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
    rng: np.random.Generator,
    *,
    rms_mm: float,
    length_mm: float,
    parts: tuple[str, ...] | None = None,
) -> Float[Array, "v 3"]:
    """Vertices moved by a random field; eyeballs move as a whole and stay round."""
    mesh = generic.mesh
    moves = smooth_field(rng, vertices, rms_mm=rms_mm, length_mm=length_mm)
    for name in ("left_eyeball", "right_eyeball"):
        ball = mesh.vertices_of(name)
        moves[ball] = moves[ball].mean(axis=0)
    chosen = np.unique(mesh.triangles[mesh.triangles_of(*(parts or mesh.part_names))])
    moved = vertices.copy()
    moved[chosen] += moves[chosen]
    return moved


def _shading(mesh: Mesh) -> Float[Array, " v"]:
    """(V,) between 0.55 and 1.1: Lambert's law under a light from above and the subject's left."""
    light = np.array([0.5, 0.55, 0.8])
    facing = mesh.vertex_normals() @ (light / np.linalg.norm(light))
    return 0.55 + 0.55 * np.maximum(facing, 0)
