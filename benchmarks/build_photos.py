"""Photos of a known head: James's, as mien builds it from its own two photos, seen anew."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from mien.head import ATLAS
from mien.io.files.image import save_image
from mien.pipelines.build import build_head
from mien.pipelines.demo import demo_photos
from mien.render.orbit import orbit_camera
from mien.render.shade import render

SMALL, LARGE = (1200, 1500), (3000, 4000)
FIELD_OF_VIEW = np.radians(30)
PITCHES = np.radians([0.0, 8.0, -8.0])
BACKGROUND = (118, 128, 136)


def save_photos(folder: Path, plans: dict[str, tuple[int, tuple[int, int]]]) -> None:
    """Renders folders of JPEGs, and `truth.npy`, the (V, 3) mm of the head they show.

    Args:
        plans: number and size (width, height) of the photos by name of the folder. Cameras are
            spread evenly over yaw -40 to 40 degrees; beyond five photos they go up and down, too.
    """
    head = build_head(demo_photos()).head
    np.save(folder / "truth.npy", head.mesh.vertices)
    for name, (count, size) in plans.items():
        for index, yaw in enumerate(np.radians(np.linspace(-40, 40, count))):
            camera = orbit_camera(
                yaw,
                PITCHES[index % 3] if count > 5 else 0.0,
                width=size[0],
                height=size[1],
                vertices=head.mesh.vertices,
                fov=FIELD_OF_VIEW,
            )
            samples = 4 if size == SMALL else 1
            picture = render(
                head.mesh, camera, head.textures[ATLAS], samples=samples, background=BACKGROUND
            )
            save_image(folder / name / f"photo_{index:02}.jpg", picture[..., :3], quality=92)


if __name__ == "__main__":
    asked = json.loads(sys.argv[2])
    save_photos(Path(sys.argv[1]), {name: (n, (w, h)) for name, (n, (w, h)) in asked.items()})
