"""The outline of somebody whose skull is larger than the head that is fitted to it."""

from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC, at
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.images.photos import Photo
from mien.capture.person_mask import PersonMask
from mien.capture.source import CapturedView
from mien.numeric.raster.rasterizer import rasterize
from mien.reconstruction.shape import outline
from mien.reconstruction.shape.outline import fit_outline

HEAD = GENERIC.mesh.vertices
SKIN = GENERIC.mesh.triangles[GENERIC.mesh.triangles_of("skin")]
SCALP = GENERIC.regions["scalp"] > 0.5


def haired(mm: float) -> Array:
    """The generic head with so much hair on its scalp."""
    return HEAD + mm * GENERIC.regions["scalp"][:, None] * GENERIC.mesh.vertex_normals()


def drawn(vertices: Array, camera: Camera) -> Array:
    depth = camera.to_camera(vertices)[:, 2]
    raster = rasterize(camera.project(vertices), depth, SKIN, camera.width, camera.height)
    return raster.mask


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch):
    """shown(vertices, cameras): photos whose person is known exactly."""

    def make(vertices: Array, cameras: list[Camera]) -> list[CapturedView]:
        masks, views = {}, []
        for k, camera in enumerate(cameras):
            pixels = np.full((camera.height, camera.width, 3), 60, np.uint8)
            mask = drawn(vertices, camera)
            pixels[mask] = (200, 150, 120)
            photo = Photo(f"{k}.png", None, pixels)  # type: ignore[arg-type]
            masks[pixels.tobytes()] = mask
            views.append(CapturedView(photo, None, None))

        def exact(pixels: Array, centre: Array, side: float) -> PersonMask:
            return PersonMask(masks[pixels.tobytes()].astype(np.float32), np.zeros(2), 1.0)

        monkeypatch.setattr(outline, "find_person", exact)
        return views

    return make


def overlap(one: Array, other: Array) -> float:
    return float((one & other).sum() / (one | other).sum())


def test_hair_becomes_skull(shown) -> None:
    truth, cameras = haired(20.0), [at(0)]
    views = shown(truth, cameras)
    found = fit_outline(HEAD, views, cameras, GENERIC, measured=False)
    before, after = (
        overlap(drawn(head, cameras[0]), drawn(truth, cameras[0])) for head in (HEAD, found)
    )
    assert before < 0.93
    assert after > 0.975
    top = SCALP & (HEAD[:, 1] > np.quantile(HEAD[SCALP, 1], 0.9))
    assert np.median((found - HEAD)[top, 1]) > 12


def test_the_right_outline_changes_nothing(shown) -> None:
    cameras = [at(-30), at(30)]
    found = fit_outline(HEAD, shown(HEAD, cameras), cameras, GENERIC, measured=True)
    assert np.linalg.norm(found - HEAD, axis=1)[np.unique(SKIN)].max() < 1.5


def test_the_face_stays(shown) -> None:
    cameras = [at(-30), at(0), at(30)]
    found = fit_outline(HEAD, shown(haired(25.0), cameras), cameras, GENERIC, measured=True)
    near = np.zeros(len(HEAD), bool)
    for point in GENERIC.points.values():
        near |= np.linalg.norm(HEAD - HEAD[point], axis=1) < 5
    assert np.linalg.norm(found - HEAD, axis=1)[near].max() < 0.5
