"""The scene of the rendering benchmark: a head whose three regions change in every frame."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.stages import peak_mb
from mien.arrays import Array, UInt8
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.mesh import Mesh
from mien.render.orbit import orbit_camera
from mien.render.shade import shown_parts
from mien.rig.state import PosedFace

FACES = 40


@dataclass(frozen=True)
class RenderScene:
    """Mesh, textures, faces and camera, prepared before the measurement.

    Attributes:
        mesh: the generic head, only the parts that pictures show.
        textures: K, synthetic.
        faces: FACES steps of a periodic movement.
    """

    mesh: Mesh
    textures: tuple[UInt8[Array, "h w 3"], ...]
    faces: tuple[PosedFace, ...]
    camera: Camera


def build_scene(width: int, height: int, textures: int, *, texels: int = 2048) -> RenderScene:
    """The generic head at a quarter turn, filling the frame as `mien render` does."""
    generic = load_generic_head()
    mesh = generic.mesh.submesh(generic.mesh.triangles_of(*shown_parts(generic.mesh)))
    eyes = generic.regions["left_eye"] + generic.regions["right_eye"]
    masks = np.stack([generic.regions["mouth"], eyes, generic.regions["forehead"]])
    jaw = generic.unit_offsets[generic.unit_names.index("jawOpen")]
    faces = []
    for frame in range(FACES):
        turn = 2 * np.pi * frame / FACES
        mixtures = _mixture_weights(turn, textures)
        weights = masks.T @ mixtures
        weights[:, 0] += 1 - weights.sum(axis=1)
        vertices = mesh.vertices + 0.3 * (1 - np.cos(turn)) * jaw
        brightness = 0.85 + 0.15 * np.tanh(mesh.vertices[:, 2] / 40)
        faces.append(PosedFace(vertices, weights, brightness))
    camera = orbit_camera(0.4, width=width, height=height, vertices=mesh.vertices)
    images = tuple(_texture(index, texels) for index in range(textures))
    return RenderScene(mesh, images, tuple(faces), camera)


def _mixture_weights(turn: float, textures: int) -> Array:
    """(3, K) for mouth, eyes and forehead, summing to 1, some of them below 0 at times."""
    phases = turn + np.arange(3)[:, None] * 2 + np.arange(textures) * 2 * np.pi / textures
    moving: Array = (1 + 1.2 * np.sin(phases)) / textures
    moving += (1 - moving.sum(axis=1, keepdims=True)) / textures
    return moving


def _texture(index: int, texels: int) -> UInt8[Array, "h w 3"]:
    """A tone of its own with detail of every size, down to single texels."""
    import cv2

    rng = np.random.default_rng(index)
    tone = np.array([170, 125, 105]) + rng.uniform(-40, 40, 3)
    total = np.broadcast_to(tone, (texels, texels, 3)).astype(np.float32)
    for size in (8, 32, 128, 512, texels):
        grain = rng.normal(0, 9, (size, size, 3)).astype(np.float32)
        total = total + cv2.resize(grain, (texels, texels), interpolation=cv2.INTER_LINEAR)
    return np.clip(np.rint(total), 0, 255).astype(np.uint8)


def measure(draw: Callable[[int], Array], seconds: float, frames: int, picture: Path) -> None:
    """Ends a measured process: frames/s, memory and growth as one line of JSON.

    Args:
        draw: the picture of a face by its number, (H, W, 4) uint8.
        seconds: to draw for at least.
        frames: at least this many.
        picture: where face 5 is kept.
    """
    np.save(picture, draw(5))
    for face in range(FACES):
        draw(face)
    held = resident_mb()
    taken: list[float] = []
    begun, used = time.perf_counter(), time.process_time()
    while time.perf_counter() - begun < seconds or len(taken) < max(frames, 5):
        start = time.perf_counter()
        draw(len(taken) % FACES)
        taken.append(time.perf_counter() - start)
    found = {
        "fps": len(taken) / sum(taken),
        "best_fps": 1 / float(np.percentile(taken, 10)),
        "cpu_ms": 1000 * (time.process_time() - used) / len(taken),
        "frames": len(taken),
        "peak_mb": peak_mb(),
        "growth_mb": resident_mb() - held,
    }
    print(json.dumps(found))


def arguments(values: Sequence[str] | None = None) -> tuple[int, int, int, int, int, Path]:
    """Width, height, textures, texels along a side, frames, and where the picture goes."""
    width, height, textures, texels, frames, picture = values or sys.argv[1:]
    return int(width), int(height), int(textures), int(texels), int(frames), Path(picture)


def resident_mb() -> float:
    """MiB that this process holds now; 0 where the kernel does not say."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0.0
    lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
    return int(lines["VmRSS"].split()[0]) / 1024
