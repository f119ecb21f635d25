"""A head whose skin is a smooth pattern that is known, for tests of tracking: exact pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.ndimage import distance_transform_edt

from mien.arrays import Array
from mien.camera import Camera
from mien.head import ATLAS, Expression, Head
from mien.numeric.raster.rasterizer import interpolate, rasterize
from mien.numeric.rotation import rotation_from_vector
from mien.render.morph import MorphRenderer
from mien.track.face_model import FaceModel, FaceParameters
from mien.track.image.drawing import Pose
from mien.track.image.frame_pyramid import FrameCrop, crop_pyramid
from mien.track.parameters import Parameters
from mien.track.photometric.linearization import PyramidLevel
from posable import GENERIC, REST, UNITS, head_of, shapes

SIZE, FOCAL = 240, 560.0
FRONT = np.diag([1.0, -1.0, -1.0])
NAMES = ("neutral", "joy", "anger")
"""Of the head's expressions; both others go with a pattern of their own."""
_TEXELS = 512


@cache
def head(names: tuple[str, ...] = NAMES) -> Head:
    """Somebody with these expressions, eyes straight ahead; `twin` is like joy."""
    made = shapes()
    made["anger"] = np.where(_eyes(), REST, made["anger"])
    made["twin"] = made["joy"]
    textures = {ATLAS: pattern(0), "joy": pattern(1), "anger": pattern(2)}
    used = {"neutral": ATLAS, "twin": "joy"}
    expressions = {
        name: Expression(made[name], texture=used.get(name, name), units=UNITS.get(name, {}))
        for name in names
    }
    textures = {name: textures[name] for name in {item.texture for item in expressions.values()}}
    return head_of(expressions=expressions, textures=textures)


@cache
def model(names: tuple[str, ...] = NAMES) -> FaceModel:
    """That head, prepared."""
    return FaceModel(head(names))


def _eyes() -> Array:
    mesh = GENERIC.mesh
    chosen = np.zeros((len(mesh.vertices), 1), bool)
    chosen[mesh.triangles[mesh.triangles_of("left_eyeball", "right_eyeball")]] = True
    return chosen


@cache
def pattern(seed: int) -> Array:
    """(h, w, 3) uint8: waves through the head's space some 3 to 6 cm long, without a seam."""
    mesh = GENERIC.mesh
    texels = np.column_stack([mesh.uvs[:, 0], 1 - mesh.uvs[:, 1]]) * _TEXELS
    flat = rasterize(texels, np.ones(len(texels)), mesh.uv_triangles, _TEXELS, _TEXELS)
    positions = interpolate(flat, mesh.triangles, REST)
    around = distance_transform_edt(~flat.mask, return_distances=False, return_indices=True)
    positions = positions[tuple(around)]
    rng = np.random.default_rng(seed)
    colours = np.full((_TEXELS, _TEXELS, 3), 125.0)
    for _ in range(5):
        direction = rng.normal(size=3)
        length = rng.uniform(30, 60)
        wave = 2 * np.pi * positions @ direction / np.linalg.norm(direction) / length
        colours += rng.uniform(8, 22, 3) * np.sin(wave + rng.uniform(0, 2 * np.pi))[..., None]
    return np.clip(np.rint(colours), 0, 255).astype(np.uint8)


def pose(
    degrees: tuple[float, float, float] = (4, 12, -3),
    place: tuple[float, float, float] = (8, -12, 620),
) -> Pose:
    """Turned about the camera's x, y and z; mm."""
    R = rotation_from_vector(np.radians(degrees)) @ FRONT
    return Pose(R, np.array(place))


def doing(
    weights: Mapping[str, tuple[float, ...]] | None = None,
    *,
    units: tuple[float, float] = (0.0, 0.0),
    gaze: tuple[float, float] = (0.0, 0.0),
    names: tuple[str, ...] = NAMES,
) -> FaceParameters:
    """A face of these weights of the expressions but neutral by region, blinks and radians."""
    shown = model(names)
    rows = np.zeros((len(shown.layout.regions), len(shown.layout.expressions)))
    for region, row in (weights or {}).items():
        rows[shown.layout.regions.index(region), 1:] = row
    rows[:, 0] = 1 - rows.sum(axis=1)
    return FaceParameters(shown.basis.alpha(rows), np.array(units), np.array(gaze))


def camera(where: Pose, *, size: int = SIZE) -> Camera:
    """That sees the head there."""
    return Camera(size, size, FOCAL * size / SIZE, where.R, where.t)


def picture(parameters: Parameters, *, names: tuple[str, ...] = NAMES, wall: int = 70) -> Array:
    """(SIZE, SIZE, 3) uint8: the rig's own face as mien's renderer draws it."""
    face = model(names).anchored(parameters.face).face
    seen_from = camera(parameters.pose)
    image = _renderer(names).render(face, seen_from, samples=9, background=(wall,) * 3)
    return np.ascontiguousarray(image[..., :3])


@cache
def _renderer(names: tuple[str, ...]) -> MorphRenderer:
    return MorphRenderer(head(names).mesh, model(names).rig.textures)


def crop(pixels: Array, where: Pose, *, face_px: float = 150.0, level: int = 0) -> FrameCrop:
    """What the tracker cuts out of a picture of the head there."""
    shown = model()
    outline = np.unique(shown.painted.triangles[shown.compared])
    points = camera(where).project(REST[outline])
    return crop_pyramid(pixels, camera(where), points, face_px=face_px, levels=level + 1)[level]


def level(
    truth: Parameters, anchor: FaceParameters | None = None, *, names: tuple[str, ...] = NAMES
) -> PyramidLevel:
    """The truth, drawn by the tracker's own means, to be explained around an anchor."""
    shown = model(names)
    cut = crop(picture(truth, names=names), truth.pose)
    of = PyramidLevel(
        shown, shown.anchored(anchor or truth.face), cut, cut.valid, cut.valid, 1e3, 150.0
    )
    return replace(of, target=of.draw(truth, layers=False).luma)
