"""Photos of heads that are known exactly. Run: python -m benchmarks.rendered FOLDER [SCENE ...]

A scene is a folder of photos with `cameras_opencv.json` and `scan.ply` (mm), which
benchmarks.scan.load_scan reads. A person on mien's own mesh also has `truth.npz`: `vertices`,
(V, 3) mm, in the cameras' frame.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.paint import Hits
from benchmarks.scan import DATA, save_scan
from benchmarks.subjects import Subject, emily, james, person
from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.io.files.image import save_image
from mien.numeric.rotation import rotation_from_vector
from mien.render.shade import rasterize_mesh

__all__ = ["SCENES", "Plan", "degraded", "portrait_camera", "render_exactly", "write_scene"]

TRUTH = "truth.npz"
FINER = 3
"""Samples along a pixel's side; a pixel is their mean, as a sensor's is."""
BACKGROUND = (52.0, 54.0, 58.0)
_BAND = 64
_FACING = np.diag([1.0, -1.0, -1.0])


def portrait_camera(
    subject: Subject,
    yaw: float,
    pitch: float = 0.0,
    roll: float = 0.0,
    *,
    focal_px: float = 4500.0,
    width: int = 900,
    height: int = 1000,
    closer: float = 1.0,
) -> Camera:
    """A camera that fills its image with the subject's face.

    Args:
        yaw: degrees; positive sees more of the left side, from above, and turns the camera so that
            the head seems to turn counter-clockwise.
        pitch: as `yaw`.
        roll: as `yaw`.
        closer: factor on the distance at which the portrait fills the image's height.
    """
    turn_y, turn_x, turn_z = rotation_from_vector(
        np.radians([[0, -yaw, 0], [pitch, 0, 0], [0, 0, -roll]])
    )
    R = turn_z @ _FACING @ turn_x @ turn_y @ subject.R_subject_portrait.T
    distance = closer * focal_px * subject.height_mm / height
    t = np.array([0.0, 0.0, distance]) - R @ subject.target
    return Camera(width, height, focal_px, R, t)


def render_exactly(
    subject: Subject,
    camera: Camera,
    *,
    finer: int = FINER,
    background: tuple[float, float, float] = BACKGROUND,
) -> UInt8[Array, "h w 3"]:
    """(H, W, 3) uint8: the mean colour over every pixel, from finer x finer places in it."""
    bands = [
        _render_band(subject, camera, first, min(first + _BAND, camera.height), finer, background)
        for first in range(0, camera.height, _BAND)
    ]
    return np.clip(np.rint(np.concatenate(bands)), 0, 255).astype(np.uint8)


def _render_band(
    subject: Subject,
    camera: Camera,
    first: int,
    end: int,
    finer: int,
    background: tuple[float, float, float],
) -> Float[Array, "h w 3"]:
    """Rows first to end - 1."""
    import cv2

    large = replace(
        camera,
        width=camera.width * finer,
        height=(end - first) * finer,
        focal_px=camera.focal_px * finer,
        principal_px=(camera.principal - [0, first]) * finer,
    )
    raster = rasterize_mesh(subject.mesh, large)
    seen = raster.mask
    colours = np.empty((large.height, large.width, 3), np.float32)
    colours[:] = background
    hits = Hits(raster.triangle_ids[seen], raster.barycentrics[seen].astype(np.float64))
    colours[seen] = subject.paint(subject.mesh, hits)
    return cv2.resize(colours, (camera.width, end - first), interpolation=cv2.INTER_AREA)


@dataclass(frozen=True)
class Plan:
    """How a scene's photos are taken.

    Attributes:
        subject: makes who is photographed.
        yaws: degrees, one a photo.
        pitches: degrees, taken in turn.
        size: (width, height) px.
        focal_px: (least, most).
        degrade: exposure, white balance and noise differ between the photos.
        expression: weights of face units in one photo, the middle one, of a person on mien's mesh.
        seed: of everything that varies at random.
    """

    subject: Callable[[], Subject]
    yaws: tuple[float, ...] = (-35, -18, 0, 18, 37)
    pitches: tuple[float, ...] = (0, 6, -4, 3, -6)
    size: tuple[int, int] = (900, 1000)
    focal_px: tuple[float, float] = (4000, 5000)
    degrade: bool = False
    expression: Mapping[str, float] = field(default_factory=dict)
    seed: int = 3

    def with_count(self, count: int) -> Plan:
        """The same with so many photos, spread over the same yaws, high, level and low in turn."""
        yaws = np.linspace(min(self.yaws), max(self.yaws), count)
        return replace(self, yaws=tuple(yaws.tolist()))


def _person_2() -> Subject:
    return person(10, DATA / "emily" / "renders_mentalray")


_JAMES = Plan(james)
_EMILY = Plan(emily, yaws=(-45, -22, 0, 22, 45), size=(1080, 1350))
# Not every draw of the identity basis looks like a person; those of these seeds do.
_PERSON_1 = Plan(lambda: person(7), yaws=(-40, -20, 0, 20, 40))
_PERSON_2 = Plan(_person_2, yaws=(-40, -20, 0, 20, 40), seed=4)
SCENES = {
    "james-5": _JAMES,
    "james-5-degraded": replace(_JAMES, degrade=True),
    "emily-5": _EMILY,
    "emily-5-degraded": replace(_EMILY, degrade=True),
    "person-1": _PERSON_1,
    "person-1-degraded": replace(_PERSON_1, degrade=True),
    "person-2": _PERSON_2,
    "person-2-expression": replace(
        _PERSON_2, expression={"jawOpen": 0.6, "mouthSmileLeft": 0.6, "mouthSmileRight": 0.6}
    ),
}


def plan_cameras(plan: Plan, subject: Subject, rng: np.random.Generator) -> dict[str, Camera]:
    """Cameras by photo stem: the plan's yaws and pitches, focal lengths and rolls at random."""
    width, height = plan.size
    return {
        f"photo_{index:02}": portrait_camera(
            subject,
            yaw,
            plan.pitches[index % len(plan.pitches)] + rng.uniform(-1, 1),
            rng.uniform(-4, 4),
            focal_px=rng.uniform(*plan.focal_px),
            width=width,
            height=height,
            closer=rng.uniform(0.95, 1.1),
        )
        for index, yaw in enumerate(plan.yaws)
    }


def write_scene(folder: Path, plan: Plan) -> None:
    """Photos as lossless PNG with their cameras and the true surface."""
    folder.mkdir(parents=True, exist_ok=True)
    # What differs between a scene and its degraded twin comes last, so that they share the rest.
    rng = np.random.default_rng(plan.seed)
    subject = plan.subject()
    cameras = plan_cameras(plan, subject, rng)
    posed = _with_expression(subject, plan.expression)
    photos = [
        render_exactly(posed if index == len(cameras) // 2 else subject, camera)
        for index, camera in enumerate(cameras.values())
    ]
    if plan.degrade:
        photos = degraded(photos, rng)
    for name, photo in zip(cameras, photos, strict=True):
        save_image(folder / f"{name}.png", photo)
    if subject.vertices is not None:
        np.savez_compressed(folder / TRUTH, vertices=subject.vertices)
    # The cameras come last: a folder that has them is whole.
    save_scan(folder, subject.mesh, cameras)


def degraded(
    photos: Sequence[UInt8[Array, "h w 3"]], rng: np.random.Generator
) -> list[UInt8[Array, "h w 3"]]:
    """Photos with exposures from 0.75 to 1.2, colour gains within 7 %, noise of 3 grey levels.

    All on sRGB-coded values; the exposures are spread over their range.
    """
    exposures = rng.permutation(np.linspace(0.75, 1.2, len(photos)))
    worse = []
    for photo, exposure in zip(photos, exposures, strict=True):
        gains = exposure * rng.uniform(0.93, 1.07, 3)
        noisy = photo * gains + rng.normal(scale=3.0, size=photo.shape)
        worse.append(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    return worse


def _with_expression(subject: Subject, expression: Mapping[str, float]) -> Subject:
    generic = load_generic_head()
    offsets = [
        weight * generic.unit_offsets[generic.unit_names.index(name)]
        for name, weight in expression.items()
    ]
    return subject.moved(np.sum(offsets, axis=0)) if offsets else subject


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes each scene asked for into a folder of its name."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rendered", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--count", type=int, help="photos of a scene, up to 24 or so")
    asked = parser.parse_args(arguments)
    for name in asked.scenes:
        if name not in SCENES:
            parser.error(f"scene: expected {', '.join(SCENES)}, found {name}")
        plan = SCENES[name] if asked.count is None else SCENES[name].with_count(asked.count)
        write_scene(asked.folder / name, plan)
        print(asked.folder / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
