"""What is done to the frames of a known performance ([Pighin 2002] sec. 6.2), and more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.track_scenes import Performance
from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.render.shade import rasterize_mesh
from mien.rig.rig import Rig

__all__ = ["Change", "changes", "covering", "face_masks"]

Frames = tuple[UInt8[Array, "h w 3"], ...]


@dataclass(frozen=True)
class Change:
    """One alteration.

    Attributes:
        name: for tables.
        apply: to a performance's frames.
        extra: how many expressions the model has beyond those that are shown.
        plain: whether the head is before one colour, and not before clutter.
    """

    name: str
    apply: Callable[[Performance, np.random.Generator], Frames] = lambda scene, _: scene.frames
    extra: int = 0
    plain: bool = False


def changes() -> tuple[Change, ...]:
    """All of [Pighin 2002]'s, and those that the issue of tracking adds."""
    gains = {
        "colours x 0.7": (0.7, 0.7, 0.7),
        "colours x 1.3": (1.3, 1.3, 1.3),
        "red x 0.7, blue x 1.3": (0.7, 1.0, 1.3),
        "red x 1.3, green x 0.85, blue x 0.7": (1.3, 0.85, 0.7),
    }
    return (
        Change("clean", plain=True),
        Change("clean, clutter behind"),
        *(Change(name, _scaled(gain)) for name, gain in gains.items()),
        Change("noise of 10 grey levels", _noisy),
        Change("four expressions in the model", extra=1),
        Change("five expressions in the model", extra=2),
        Change("half resolution", _halved),
        Change("a quarter covered, still", _covered(moving=False)),
        Change("a quarter covered, moving", _covered(moving=True)),
    )


def _scaled(gain: tuple[float, float, float]) -> Callable[..., Frames]:
    return lambda scene, _: tuple(_quantized(frame * np.array(gain)) for frame in scene.frames)


def _noisy(scene: Performance, rng: np.random.Generator) -> Frames:
    """Every channel of every pixel for itself."""
    return tuple(_quantized(frame + rng.normal(0, 10, frame.shape)) for frame in scene.frames)


def _halved(scene: Performance, _: np.random.Generator) -> Frames:
    import cv2

    size = (scene.truth.width // 2, scene.truth.height // 2)
    return tuple(cv2.resize(frame, size, interpolation=cv2.INTER_AREA) for frame in scene.frames)


def _quantized(values: Float[Array, "h w 3"]) -> UInt8[Array, "h w 3"]:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _covered(*, moving: bool) -> Callable[..., Frames]:
    def apply(scene: Performance, rng: np.random.Generator) -> Frames:
        hands, colours = covering(scene, moving=moving), _skin(scene, rng)
        return tuple(
            np.where(hand[..., None], colours, frame)
            for hand, frame in zip(hands, scene.frames, strict=True)
        )

    return apply


def covering(
    scene: Performance, *, moving: bool, share: float = 0.25
) -> tuple[Bool[Array, "h w"], ...]:
    """(H, W) of every frame: a hand before the face, as large as makes it cover this share of the

    face in the mean.

    It stays at the cheek and the corner of the mouth, or wanders over the face and back.
    """
    size = scene.truth.width
    masks = face_masks(scene)
    turn = 2 * np.pi * np.arange(len(masks)) / len(masks)
    places = np.column_stack([0.24 * np.cos(turn), 0.2 * np.sin(2 * turn)])
    if not moving:
        places[:] = (0.12, 0.12)
    # In the picture, not on the face: the head moves under the hand.
    centres = size * (0.5 + places)
    low, high = 0.02 * size, 0.5 * size
    hands: tuple[Bool[Array, "h w"], ...] = ()
    for _ in range(12):
        scale = (low + high) / 2
        hands = tuple(_hand(size, centre, scale) for centre in centres)
        covered = np.mean(
            [(hand & m).sum() / m.sum() for hand, m in zip(hands, masks, strict=True)]
        )
        low, high = (low, scale) if covered > share else (scale, high)
    return hands


def face_masks(scene: Performance) -> list[Bool[Array, "h w"]]:
    """(H, W) of every frame: the pixels that show skin of the face."""
    generic, rig = load_generic_head(), Rig(scene.head)
    mesh = scene.head.mesh
    face = generic.regions["face"][mesh.triangles].min(axis=1) > 0.5
    masks = []
    for frame in scene.truth.frames:
        assert frame.state is not None
        posed = mesh.with_vertices(rig.evaluate(frame.state.face(scene.truth.layout)).vertices)
        seen = rasterize_mesh(posed, scene.truth.camera(frame.state)).triangle_ids
        masks.append((seen >= 0) & face[seen])
    return masks


def _hand(size: int, centre: Float[Array, " 2"], scale: float) -> Bool[Array, "h w"]:
    """A palm and four fingers, of so many px in radius."""
    import cv2

    image = np.zeros((size, size), np.uint8)
    cv2.circle(image, _pixel(centre), round(scale), 255, -1)
    for angle in (-0.55, -0.2, 0.15, 0.5):
        along = np.array([np.sin(angle), -np.cos(angle)])
        ends = (centre + 0.6 * scale * along, centre + 1.9 * scale * along)
        cv2.line(image, _pixel(ends[0]), _pixel(ends[1]), 255, max(1, round(0.32 * scale)))
    return image > 0


def _pixel(point: Float[Array, " 2"]) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))


def _skin(scene: Performance, rng: np.random.Generator) -> UInt8[Array, "h w 3"]:
    """(H, W, 3): the face's own tone, shaded and grained as a palm is."""
    import cv2

    size = scene.truth.width
    tone = np.median(scene.frames[0][face_masks(scene)[0]], axis=0)
    shade = np.linspace(1.15, 0.8, size)[None, :, None] * np.ones((size, 1, 1))
    grain = np.zeros((size, size), np.float32)
    for cells in (12, 40, 120):
        noise = rng.normal(0, 6, (cells, cells)).astype(np.float32)
        grain += cv2.resize(noise, (size, size), interpolation=cv2.INTER_LINEAR)
    return _quantized(tone * shade + grain[..., None])


def extra_expressions(names: Sequence[str], shown: Sequence[str], count: int) -> tuple[str, ...]:
    """As many of a head's expressions as are wanted beyond those that are shown."""
    return tuple(name for name in names if name not in shown)[:count]
