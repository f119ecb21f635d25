"""A performance that is known exactly: head, path, weights and every frame of it.

Three expressions are blended uniformly over the whole face while the head turns by 25 degrees to
either side, nods, tilts and moves along all three axes.

Source:
    [Pighin 2002] sec. 6.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.subjects import DEMO, person_vertices
from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.errors import InputError
from mien.head import ATLAS, NEUTRAL, Expression, Head
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import interpolate, rasterize
from mien.numeric.rotation import rotation_from_vector
from mien.pipelines.build import BuildOptions, build_head
from mien.render.morph import MorphRenderer
from mien.rig.rig import Rig
from mien.track.state import Layout, Track, TrackedFrame, TrackState

__all__ = [
    "REGIONS",
    "Performance",
    "choose_three",
    "known_path",
    "known_weights",
    "made_up_head",
    "perform",
    "with_expressions",
]

REGIONS = ("mouth", "eyes", "forehead")
SIZE, FOCAL_PX, FPS, FRAMES = 300, 620.0, 25.0, 80
PLAIN = (52, 54, 58)

_FACING = np.diag([1.0, -1.0, -1.0])
_MIDDLE = np.array([0.0, -25.0, -60.0])
"""mm: about where a neck turns a head."""
_DISTANCE_MM = 640.0
_KEYS = (
    (0.0, (1.0, 0.0, 0.0)),
    (0.05, (1.0, 0.0, 0.0)),
    (0.2, (0.0, 1.0, 0.0)),
    (0.3, (1.0, 0.0, 0.0)),
    (0.47, (0.0, 0.0, 1.0)),
    (0.57, (1.0, 0.0, 0.0)),
    (0.68, (0.4, 0.4, 0.2)),
    (0.78, (0.0, 0.5, 0.5)),
    (0.9, (0.3, 0.1, 0.6)),
    (1.0, (1.0, 0.0, 0.0)),
)
"""Share of the time, and the weights of neutral and of the two others there."""

_MADE_UP = {
    "anger": {"browDown": 1.0, "noseSneer": 0.7, "mouthFrown": 0.5, "mouthPress": 0.5},
    "joy": {"mouthSmile": 0.9, "cheekSquint": 0.8, "browOuterUp": 0.5, "jawOpen": 0.12},
    "awe": {"jawOpen": 0.6, "browInnerUp": 0.9, "browOuterUp": 0.8, "eyeWide": 0.6},
    "sulk": {"mouthPucker": 0.7, "mouthShrugLower": 0.6, "browInnerUp": 0.5, "eyeBlink": 0.3},
}
_ALIKE = {
    "anger": ("anger", "brows_down", "frown", "sneer", "pressed_lips", "brows_up"),
    "joy": ("joy", "smile", "upper_teeth", "open_mouth", "lower_teeth"),
}
"""Expressions of a head from a clip that can play a part, the likeliest first."""


@dataclass(frozen=True)
class Performance:
    """What is tracked, and the truth about it.

    Attributes:
        head: with the expressions that are shown, neutral first, and no others.
        truth: exact.
        frames: (H, W, 3), one a frame of the truth.
    """

    head: Head
    truth: Track
    frames: tuple[UInt8[Array, "h w 3"], ...]


def known_path(frames: int = FRAMES) -> tuple[Float[Array, "n 3 3"], Float[Array, "n 3"]]:
    """(N, 3, 3) and (N, 3) mm, `R_cam_head` and `t_cam_head` of a head that turns and moves.

    25 degrees of yaw to either side, 8 of pitch, 6 of roll; 30 mm sideways, 18 mm up and down,
    60 mm to and fro, at 640 mm.
    """
    turn = 2 * np.pi * np.arange(frames) / max(frames - 1, 1)
    angles = np.radians([8 * np.sin(2 * turn), 25 * np.sin(turn), 6 * np.sin(3 * turn)])
    about_x, about_y, about_z = (
        rotation_from_vector(angles[axis][:, None] * np.eye(3)[axis]) for axis in range(3)
    )
    rotations = about_z @ _FACING @ about_x @ about_y
    shifts = [30 * np.sin(turn + 0.6), 18 * np.sin(2 * turn + 1), 60 * np.sin(turn * 1.5)]
    places = np.column_stack(shifts) + np.array([0.0, 0.0, _DISTANCE_MM])
    return rotations, places - rotations @ _MIDDLE


def known_weights(frames: int = FRAMES) -> Float[Array, "n 3"]:
    """(N, 3) of neutral and two others: each alone and back, then mixtures of all three."""
    times, rows = np.array([time for time, _ in _KEYS]), np.array([row for _, row in _KEYS])
    now = np.linspace(0, 1, frames)
    after = np.clip(np.searchsorted(times, now, side="right"), 1, len(times) - 1)
    share = (now - times[after - 1]) / (times[after] - times[after - 1])
    eased = (share**2 * (3 - 2 * share))[:, None]
    return (1 - eased) * rows[after - 1] + eased * rows[after]


def perform(
    head: Head,
    *,
    frames: int = FRAMES,
    size: int = SIZE,
    background: tuple[int, int, int] | UInt8[Array, "h w 3"] = PLAIN,
) -> Performance:
    """The head, which has three expressions, along the known path.

    Drawn by mien's own renderer with nine samples a pixel, as the paper's sequence was drawn with
    the model that is fitted to it.
    """
    rig = Rig(head)
    renderer = MorphRenderer(head.mesh, rig.textures)
    layout = Layout(REGIONS, rig.names)
    focal = FOCAL_PX * size / SIZE
    states = [
        TrackState(R, t, np.tile(row, (len(REGIONS), 1)), np.zeros(0), np.zeros(2))
        for R, t, row in zip(*known_path(frames), known_weights(frames), strict=True)
    ]
    truth = Track(layout, size, size, focal, FPS, tuple(map(_exactly, range(frames), states)))
    images = [
        renderer.render(
            rig.evaluate(state.face(layout)), truth.camera(state), samples=9, background=background
        )
        for state in states
    ]
    return Performance(head, truth, tuple(np.ascontiguousarray(image[..., :3]) for image in images))


def _exactly(frame: int, state: TrackState) -> TrackedFrame:
    return TrackedFrame(
        frame,
        frame / FPS,
        "ok",
        state,
        rms=0.0,
        seen=1.0,
        deviations=np.zeros(len(REGIONS) * state.weights.shape[1] + 2),
        gain=np.ones(3),
        bias=np.zeros(3),
    )


def choose_three(head: Head) -> tuple[str, str, str]:
    """Neutral and the expressions of this head that are likest to anger and joy.

    Raises:
        InputError: it has fewer than three.
    """
    others = [name for name in head.expressions if name != NEUTRAL]
    if len(others) < 2:
        raise InputError("head", "two expressions beside neutral", ", ".join(others) or "none")
    chosen: list[str] = []
    for part in _ALIKE.values():
        known = [name for name in (*part, *others) if name in others and name not in chosen]
        chosen.append(known[0])
    return NEUTRAL, chosen[0], chosen[1]


def with_expressions(head: Head, names: Sequence[str]) -> Head:
    """The head with these expressions alone, in this order, neutral first."""
    missing = [name for name in names if name not in head.expressions]
    if missing or names[0] != NEUTRAL:
        known = ", ".join(head.expressions)
        raise InputError("expressions", f"neutral and others of {known}", ", ".join(names))
    expressions = {name: head.expressions[name] for name in names}
    used = {item.texture for item in expressions.values()} & set(head.textures)
    textures = {name: head.textures[name] for name in head.textures if name in used}
    return replace(head, expressions=expressions, textures=textures)


def made_up_head(*, texture_size: int = 1024) -> Head:
    """Somebody who never lived, in the skin of the man whose photos ship with mien.

    Its expressions are face units and a smooth deformation of their own; where an expression
    compresses the skin it is darker, as wrinkles make it.
    """
    generic = load_generic_head()
    built = build_head(DEMO, options=BuildOptions(texture_size=texture_size)).head
    neutral = person_vertices(7)
    mesh = generic.mesh.with_vertices(neutral)
    expressions = {NEUTRAL: Expression(neutral)}
    textures = {ATLAS: built.textures[ATLAS]}
    for name, given in _MADE_UP.items():
        units = _both_sides(given, generic)
        weights = np.array([units.get(unit, 0.0) for unit in generic.unit_names])
        vertices = neutral + np.tensordot(weights, generic.unit_offsets, axes=1)
        expressions[name] = Expression(vertices, texture=name, units=units)
        textures[name] = _wrinkled(textures[ATLAS], mesh, vertices)
    return replace(
        built,
        subject="Nobody",
        mesh=mesh,
        expressions=expressions,
        textures=textures,
        unit_offsets=generic.unit_offsets,
        unit_names=generic.unit_names,
    )


def _both_sides(given: dict[str, float], generic: GenericHead) -> dict[str, float]:
    """Units by their full names; one without a side is that of both."""
    units = {}
    for name, weight in given.items():
        sides = [name] if name in generic.unit_names else [f"{name}Left", f"{name}Right"]
        units.update(dict.fromkeys(sides, weight))
    return units


def _wrinkled(
    atlas: UInt8[Array, "h w 3"], mesh: Mesh, vertices: Float[Array, "v 3"]
) -> UInt8[Array, "h w 3"]:
    """The texture, darker where the skin has become smaller, lighter where it is stretched."""
    before, now = (
        np.linalg.norm(item.triangle_normals(), axis=1)
        for item in (mesh, mesh.with_vertices(vertices))
    )
    stretch = np.log(np.maximum(now, 1e-3) / np.maximum(before, 1e-3))
    total, count = np.zeros(len(vertices)), np.zeros(len(vertices))
    skin = mesh.triangles_of("skin")
    for corner in mesh.triangles[skin].T:
        np.add.at(total, corner, stretch[skin])
        np.add.at(count, corner, 1.0)
    factor = 1 + 0.3 * np.tanh(1.5 * total / np.maximum(count, 1))
    return _shaded(atlas, mesh, factor)


def _shaded(
    atlas: UInt8[Array, "h w 3"], mesh: Mesh, factor: Float[Array, " v"]
) -> UInt8[Array, "h w 3"]:
    """The texture times a factor that is known at the vertices."""
    import cv2

    size = atlas.shape[0]
    pixels = np.column_stack([mesh.uvs[:, 0], 1 - mesh.uvs[:, 1]]) * size
    flat = rasterize(pixels, np.ones(len(pixels)), mesh.uv_triangles, size, size)
    field = interpolate(flat, mesh.triangles, factor[:, None])[..., 0]
    # Soft, and 1 outside of the charts, so that no seam shows.
    field = cv2.GaussianBlur(np.where(flat.mask, field, 1.0), (0, 0), size / 256)
    return np.clip(np.rint(atlas * field[..., None]), 0, 255).astype(np.uint8)


def cluttered(size: int, rng: np.random.Generator) -> UInt8[Array, "h w 3"]:
    """A background of coloured boxes and discs over noise of many sizes."""
    import cv2

    image = np.full((size, size, 3), 110.0, np.float32)
    for cells in (3, 9, 30, 100):
        grain = rng.normal(0, 16, (cells, cells, 3)).astype(np.float32)
        image += cv2.resize(grain, (size, size), interpolation=cv2.INTER_LINEAR)
    for _ in range(24):
        colour = tuple(rng.uniform(20, 230, 3).tolist())
        corner, extent = rng.integers(0, size, 2), rng.integers(size // 20, size // 5, 2)
        first, last = tuple(corner.tolist()), tuple((corner + extent).tolist())
        if rng.random() < 0.5:
            cv2.rectangle(image, first, last, colour, -1, cv2.LINE_AA)
        else:
            cv2.circle(image, first, int(extent[0]) // 2, colour, -1, cv2.LINE_AA)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)
