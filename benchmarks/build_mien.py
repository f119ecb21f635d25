"""One measured build by mien. Run: python -m benchmarks.build_mien PHOTOS FOLDER"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.stages import Stages, peak_mb, report

if TYPE_CHECKING:
    from mien.pipelines.build import Build

LANDMARKS, RESULT = "landmarks.npz", "mien.reading.npz"
USED_ABOVE = 0.1
"""Less confident landmarks are neither given to the peer nor compared; nor does mien use them."""


def main(photos: Path, folder: Path) -> None:
    """Photos to a head folder and a `.glb`, stage by stage; then what the comparison needs."""
    from mien.io.mesh.export import export_head
    from mien.pipelines.build import build_head_folder

    stages = Stages()
    built = build_head_folder(photos, folder / "head", progress=lambda stage, *_: stages.lap(stage))
    export_head(built.head, folder / "head.glb")
    stages.lap("Exporting")
    peak = peak_mb()
    _save_landmarks(built, folder / LANDMARKS)
    _save_result(built, folder / RESULT)
    report(stages, peak)


def _save_landmarks(built: Build, path: Path) -> None:
    """The photos' paths, (K, 478, 2) px and (K, 478) which of them count."""
    import numpy as np

    from mien.assets.generic import load_generic_head

    attached = load_generic_head().landmark_attached
    views = [view for view in built.capture.views if view.landmarks is not None]
    found = [view.landmarks for view in views if view.landmarks is not None]
    np.savez(
        path,
        photos=[str(view.photo.path) for view in views],
        points=[landmarks.points for landmarks in found],
        used=[attached & (landmarks.confidence > USED_ABOVE) for landmarks in found],
    )


def _save_result(built: Build, path: Path) -> None:
    """(V, 3) mm of the head and (K, 478, 2) px where its landmarks lie in the photos."""
    import numpy as np

    from mien.assets.generic import load_generic_head

    vertices = built.head.mesh.vertices
    places = load_generic_head().landmark_positions(vertices)
    projected = [
        built.head.view(view.photo.name).camera.project(places)
        for view in built.capture.views
        if view.landmarks is not None
    ]
    np.savez(path, vertices=vertices, projected=projected)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
