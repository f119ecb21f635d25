"""Photos of people that are known exactly: any lens, crop, light and expression.

A person is drawn from the identity basis and, since nobody lies in a basis, bent smoothly besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.dense.prior import load_head_prior
from mien.render.morph import MorphRenderer
from mien.rig.state import PosedFace

__all__ = ["SyntheticPhoto", "random_photo"]

DISTANCE_MM = (300.0, 3000.0)
LENS_MM = (14.0, 200.0)
"""Of a 36 by 24 mm frame."""
FACE_SHARE = (0.25, 0.6)
"""Height of the face, chin to brows' top, of the picture's."""
SIDE_PX = (700, 1400)
BENT = 0.5
"""Of the deviations that the registration's prior expects beyond the identity basis."""
TURN_DEG = (22.0, 10.0, 8.0)
"""Standard deviation of yaw, pitch and roll."""
_FACE_MM = 130.0
_FACING = np.diag([1.0, -1.0, -1.0])
_MIDDLE = np.array([0.0, -35.0, 0.0])

EXPRESSIONS: dict[str, dict[str, float]] = {
    "rest": {},
    "smile": {"mouthSmile": 0.7, "cheekSquint": 0.4, "eyeSquint": 0.3},
    "laugh": {
        "mouthSmile": 0.9,
        "mouthUpperUp": 0.5,
        "jawOpen": 0.25,
        "cheekSquint": 0.6,
        "eyeSquint": 0.5,
    },
    "talk": {"jawOpen": 0.35, "mouthFunnel": 0.3},
    "surprise": {"browInnerUp": 0.8, "browOuterUp": 0.7, "eyeWide": 0.5, "jawOpen": 0.3},
    "frown": {"browDown": 0.8, "mouthFrown": 0.4, "mouthPress": 0.3},
}


@dataclass(frozen=True)
class SyntheticPhoto:
    """A picture and the truth about it.

    Attributes:
        pixels: (H, W, 3).
        camera: exact.
        vertices: (V, 3) mm, of the face as it was photographed.
        mask: (H, W) where the person is.
        expression: of EXPRESSIONS.
        exif_focal_px: what the file would state; None for nothing.
        exif_is_right: whether that is true.
        mirrored: whether the picture was turned over, left for right; camera and vertices are of
            the scene before.
    """

    pixels: UInt8[Array, "h w 3"]
    camera: Camera
    vertices: Float[Array, "v 3"]
    mask: Bool[Array, "h w"]
    expression: str
    exif_focal_px: float | None
    exif_is_right: bool
    mirrored: bool


def random_photo(
    rng: np.random.Generator,
    textures: Sequence[UInt8[Array, "h w 3"]],
    *,
    expression: str | None = None,
    distance_mm: float | None = None,
    mirrored: bool = False,
) -> SyntheticPhoto:
    """Somebody photographed somehow.

    Args:
        rng: decides everything else.
        textures: atlases of real faces, of which one is taken.
        expression: of EXPRESSIONS; any unless given.
        distance_mm: from the camera to the eyes; any unless given.
        mirrored: as a front camera turns it over.
    """
    generic = load_generic_head()
    name = expression or str(rng.choice(list(EXPRESSIONS)))
    vertices = _person(rng, generic) + _expressed(rng, generic, EXPRESSIONS[name])
    camera = _camera(rng, distance_mm)
    texture = textures[int(rng.integers(len(textures)))]
    shading = _shading(rng, generic, vertices)
    face = PosedFace(vertices, np.ones((len(vertices), 1)), shading)
    parts = tuple(part for part in generic.mesh.part_names if part not in ("hair", "lashes"))
    drawn = MorphRenderer(generic.mesh, [texture], parts=parts).render(face, camera)
    alpha = drawn[..., 3:] / 255.0
    picture = alpha * drawn[..., :3] + (1 - alpha) * _background(rng, camera)
    picture = picture * rng.uniform(0.7, 1.15) + rng.normal(0, rng.uniform(0, 5), picture.shape)
    pixels = np.clip(picture, 0, 255).astype(np.uint8)
    stated, right = _exif(rng, camera.focal_px)
    mask = drawn[..., 3] > 127
    if mirrored:
        pixels, mask = np.ascontiguousarray(pixels[:, ::-1]), mask[:, ::-1]
    return SyntheticPhoto(pixels, camera, vertices, mask, name, stated, right, mirrored)


def _person(rng: np.random.Generator, generic: GenericHead) -> Float[Array, "v 3"]:
    prior = load_head_prior()
    coefficients = rng.normal(size=len(prior.components))
    coefficients[prior.identity_count :] *= BENT
    return prior.vertices(coefficients)


def _expressed(
    rng: np.random.Generator, generic: GenericHead, units: dict[str, float]
) -> Float[Array, "v 3"]:
    """(V, 3) mm: the expression, no two of them the same and none quite symmetric."""
    weights = np.zeros(len(generic.unit_names))
    for unit, weight in units.items():
        for k, name in enumerate(generic.unit_names):
            if name in (unit, f"{unit}Left", f"{unit}Right"):
                weights[k] = np.clip(weight * rng.uniform(0.7, 1.2), 0, 1)
    return np.tensordot(weights, generic.unit_offsets, 1)


def _camera(rng: np.random.Generator, distance_mm: float | None) -> Camera:
    """Somewhere before the face, which lies somewhere in the picture."""
    width, height = rng.integers(*SIDE_PX, 2).tolist()
    distance = distance_mm or float(np.exp(rng.uniform(*np.log(DISTANCE_MM))))
    share = rng.uniform(*FACE_SHARE)
    focal_px = share * min(width, height) * distance / _FACE_MM
    turns = np.radians(rng.normal(size=3) * TURN_DEG)
    rotation = _FACING
    for axis, turn in ((2, turns[2]), (0, turns[1]), (1, turns[0])):
        rotation = rotation @ rotation_from_vector(turn * np.eye(3)[axis])
    room = (1 - share) / 2 * min(width, height) * 0.5
    shift = rng.uniform(-room, room, 2) * distance / focal_px
    place = np.array([*shift, distance]) - rotation @ _MIDDLE
    return Camera(width, height, focal_px, rotation, place)


def _shading(
    rng: np.random.Generator, generic: GenericHead, vertices: Float[Array, "v 3"]
) -> Float[Array, " v"]:
    """(V,) brightness under a lamp and the light of the room."""
    lamp = rng.normal(size=3) + np.array([0, 0.7, 1.5])
    lamp /= np.linalg.norm(lamp)
    normals = generic.mesh.with_vertices(vertices).vertex_normals()
    ambient = rng.uniform(0.5, 1.0)
    return ambient + (1.1 - ambient) * np.maximum(normals @ lamp, 0)


def _background(rng: np.random.Generator, camera: Camera) -> Float[Array, "h w 3"]:
    """(H, W, 3) soft shapes of any colour."""
    import cv2

    coarse = rng.uniform(20, 235, (rng.integers(2, 9), rng.integers(2, 9), 3)).astype(np.float32)
    size = (camera.width, camera.height)
    return cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC).astype(float)


def _exif(rng: np.random.Generator, focal_px: float) -> tuple[float | None, bool]:
    """Nothing, the truth, or the truth about the picture that this one was cut from."""
    kind = rng.uniform()
    if kind < 0.5:
        return None, True
    return (focal_px, True) if kind < 0.8 else (focal_px / rng.uniform(1.6, 4), False)
