"""Photos without a face, placed by the others or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from marbled import GENERIC, SIZE, Person, at, clutter, photographed
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.images.photos import Photo
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.numeric.rotation import angle_between
from mien.reconstruction.fit import FitOptions, fit_views
from mien.reconstruction.localization import localize_view, localize_views
from people import cameras, person
from people import photographed as marked

Known = list[tuple[CapturedView, Camera]]
TRUE = {"left": at(75.0, 12.0, 6.0), "right": at(-90.0, -8.0, distance=1100.0)}


def view_of(pixels: Array) -> CapturedView:
    return CapturedView(
        Photo("photo.png", Path("photo.png"), np.ascontiguousarray(pixels)), None, None
    )


def landscape() -> Array:
    return np.repeat(clutter(SIZE[1], SIZE[0], 9)[..., None], 3, axis=2).astype(np.uint8)


@pytest.fixture(scope="module")
def placed(ann: Person, frontal: Known) -> dict[str, Camera | None]:
    """Her profiles, what references like profiles of hers, and what does not."""
    views = {name: ann.seen_by(camera) for name, camera in TRUE.items()}
    views["mirrored"] = view_of(views["left"].photo.pixels[:, ::-1])
    views["somebody else"] = Person(ann.vertices, 2).seen_by(TRUE["left"])
    views["landscape"] = view_of(landscape())
    found = localize_views(list(views.values()), frontal, ann.vertices, GENERIC)
    return dict(zip(views, found, strict=True))


@pytest.mark.parametrize("name", list(TRUE))
def test_profile_is_placed(placed: dict[str, Camera | None], name: str, ann: Person) -> None:
    camera = placed[name]
    assert camera is not None
    assert (camera.width, camera.height) == SIZE
    assert np.degrees(angle_between(camera.R_cam_head, TRUE[name].R_cam_head)) < 1
    assert np.abs(camera.project(ann.vertices) - TRUE[name].project(ann.vertices)).max() < 2


@pytest.mark.parametrize("name", ["mirrored", "somebody else", "landscape"])
def test_what_shows_something_else_is_not(placed: dict[str, Camera | None], name: str) -> None:
    assert placed[name] is None


def test_a_placed_photo_helps_to_place_the_next(ann: Person) -> None:
    """Of the right side the first photo shows next to nothing."""
    (first,) = photographed(ann, (0.0,))
    far, between = at(-110.0), at(-60.0, 5.0)
    views = [ann.seen_by(far), ann.seen_by(between)]
    assert localize_view(views[0], [first], ann.vertices, GENERIC) is None
    found = localize_views(views, [first], ann.vertices, GENERIC)
    for camera, true in zip(found, (far, between), strict=True):
        assert camera is not None
        assert np.degrees(angle_between(camera.R_cam_head, true.R_cam_head)) < 2


def test_without_other_photos_there_is_nothing_to_go_by(ann: Person) -> None:
    view = ann.seen_by(TRUE["left"])
    assert localize_view(view, [], ann.vertices, GENERIC) is None
    assert localize_views([view], [], ann.vertices, GENERIC) == (None,)
    assert localize_views([], [], ann.vertices, GENERIC) == ()


def test_photo_without_marks_does_not_trouble_the_fit() -> None:
    vertices = person(0)
    views = [
        marked(vertices, seen_from, name=f"{k}.png") for k, seen_from in enumerate(cameras()[1:3])
    ]
    views.append(view_of(landscape()))
    fit = fit_views(views, GENERIC, FitOptions(rounds=1, dense=False))
    assert list(fit.photos) == ["0.png", "1.png"]
    assert "photo.png" in fit.left_out


def test_photos_without_marks_alone_make_no_head() -> None:
    with pytest.raises(EstimationError):
        fit_views([view_of(landscape())], GENERIC, FitOptions())
