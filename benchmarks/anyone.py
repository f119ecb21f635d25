"""Single photos of anyone: surface, outline, distance, grade. Run: python -m benchmarks.anyone"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.anyone_synthetic import EXPRESSIONS, SyntheticPhoto, random_photo
from benchmarks.subjects import DEMO
from benchmarks.table import markdown_table, write_results
from mien.arrays import Array, Bool, Float
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import Photo
from mien.capture.source import CapturedView
from mien.errors import MienError
from mien.head import ATLAS
from mien.numeric.raster.rasterizer import rasterize
from mien.numeric.similarity import estimate_similarity
from mien.pipelines.build import BuildOptions, build_head
from mien.reconstruction.fit import FitOptions, fit_views


@dataclass(frozen=True)
class Result:
    """One photo.

    Attributes:
        photo: with the truth.
        same_point_mm: median distance to the same points of the true face, after a similarity.
        surface_mm: the same along the normals.
        unfitted: both of the unfitted mean head.
        distance_ratio: of the camera's distance to the true one.
        overlap: intersection over union of the drawn skin and the person.
        grade: the verdict's.
    """

    photo: SyntheticPhoto
    same_point_mm: float
    surface_mm: float
    unfitted: tuple[float, float]
    distance_ratio: float
    overlap: float
    grade: str

    @property
    def is_worse(self) -> bool:
        """Than the unfitted head by more than a tenth."""
        return self.same_point_mm > 1.1 * self.unfitted[0]


def face_errors(
    vertices: Float[Array, "v 3"], truth: Float[Array, "v 3"], generic: GenericHead
) -> tuple[float, float]:
    """Medians over the face after a similarity: to the same points, and along the normals."""
    face = np.flatnonzero(generic.regions["face"] > 0.5)
    aligned = estimate_similarity(vertices[face], truth[face])(vertices[face])
    off = aligned - truth[face]
    along = (off * generic.mesh.with_vertices(truth).vertex_normals()[face]).sum(axis=1)
    return float(np.median(np.linalg.norm(off, axis=1))), float(np.median(np.abs(along)))


def measure(
    photo: SyntheticPhoto, detector: LandmarkDetector, generic: GenericHead
) -> Result | None:
    """A head of the photo alone; None where no face is found in it."""
    picture = Photo("photo.png", Path("photo.png"), photo.pixels, photo.exif_focal_px)
    try:
        view = CapturedView(picture, detector.detect(picture), None)
        fit = fit_views([view], generic, FitOptions())
    except MienError:
        return None
    camera = fit.photos["photo.png"].camera
    truth = photo.vertices * [-1, 1, 1] if photo.mirrored else photo.vertices
    truth = truth[generic.mirror] if photo.mirrored else truth
    drawn = _drawn(fit.vertices, camera, generic)
    return Result(
        photo,
        *face_errors(fit.vertices, truth, generic),
        face_errors(generic.mesh.vertices, truth, generic),
        float(camera.t_cam_head[2] / photo.camera.t_cam_head[2]),
        float((drawn & photo.mask).sum() / (drawn | photo.mask).sum()),
        fit.verdict.grade,
    )


def _drawn(
    vertices: Float[Array, "v 3"], camera: Camera, generic: GenericHead
) -> Bool[Array, "h w"]:
    skin = generic.mesh.triangles[generic.mesh.triangles_of("skin")]
    depth = camera.to_camera(vertices)[:, 2]
    return rasterize(camera.project(vertices), depth, skin, camera.width, camera.height).mask


def results(count: int, textures: Sequence[Array]) -> Iterator[Result]:
    """Of so many people, one photo each; one in ten is mirrored."""
    generic = load_generic_head()
    with LandmarkDetector() as detector:
        for seed in range(count):
            rng = np.random.default_rng(seed)
            photo = random_photo(rng, textures, mirrored=seed % 10 == 9)
            found = measure(photo, detector, generic)
            if found is not None:
                yield found


HEADER = (
    "expression",
    "photos",
    "same point, mm",
    "surface, mm",
    "over the unfitted head's",
    "outline IoU",
    "distance within 25 %",
    "worse than unfitted, not poor",
    "good, fair, poor",
)


def row(name: str, found: Sequence[Result]) -> list[str]:
    """Medians, and shares of the photos."""
    ratio = np.median([item.same_point_mm / item.unfitted[0] for item in found])
    near = np.mean([abs(np.log(item.distance_ratio)) < np.log(1.25) for item in found])
    silent = sum(item.is_worse and item.grade != "poor" for item in found)
    grades = [sum(item.grade == grade for item in found) for grade in ("good", "fair", "poor")]
    return [
        name,
        str(len(found)),
        f"{np.median([item.same_point_mm for item in found]):.2f}",
        f"{np.median([item.surface_mm for item in found]):.2f}",
        f"{ratio:.2f}",
        f"{np.median([item.overlap for item in found]):.3f}",
        f"{near:.0%}",
        str(silent),
        ", ".join(map(str, grades)),
    ]


INTRO = (
    "Renders of people drawn from the identity basis and bent besides, by cameras at 300 to 3,000 "
    "mm, any lens and crop, six expressions, any light, some noise, EXIF absent, right or wrong. "
    "Heads of one photo each, over the face, after a similarity."
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="how many people")
    count = parser.parse_args().count
    head = build_head(DEMO, options=BuildOptions(texture_size=1024)).head
    found = list(results(count, [head.textures[ATLAS]]))
    groups = {
        name: [item for item in found if item.photo.expression == name] for name in EXPRESSIONS
    }
    groups["smile or laugh"] = groups["smile"] + groups["laugh"]
    groups["all"] = found
    rows = [row(name, group) for name, group in groups.items() if group]
    write_results("anyone", "Single photos of anyone", [INTRO, markdown_table(HEADER, rows)])


if __name__ == "__main__":
    main()
