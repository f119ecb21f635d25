"""Fits of photos that say something wrong about themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marbled import GENERIC, Person, detected, photographed
from mien.capture.source import CapturedView, load_capture
from mien.numeric.rotation import angle_between
from mien.pipelines.demo import demo_photos
from mien.reconstruction.fit import MIRRORED, WRONG_FOCAL, FitOptions, fit_views
from mien.reconstruction.mirroring import mirrored_view
from people import person


def stating(view: CapturedView, focal_px: float) -> CapturedView:
    return replace(view, photo=replace(view.photo, focal_prior_px=focal_px))


def test_a_focal_length_that_the_photos_contradict_is_not_used() -> None:
    """James's photos through a lens of 6,400 px, cut from ones twice as wide."""
    views = [replace(view, annotations=None) for view in load_capture(demo_photos()).views]
    factor = views[0].photo.size[0] / 1200
    fit = fit_views([stating(view, 3200 * factor) for view in views], GENERIC, FitOptions())
    names = ", ".join(view.photo.name for view in views)
    assert WRONG_FOCAL.format(names) in fit.notes
    for item in fit.photos.values():
        assert 0.85 * 5800 < item.camera.focal_px / factor < 1.15 * 6400
    assert fit.verdict.grade == "fair"
    assert fit.registered


def test_a_mirrored_photo_is_turned_back() -> None:
    who = Person(person(3), 1)
    photos = photographed(who, (-30.0, -10.0, 10.0, 30.0))
    views = [detected(view, camera, who.vertices) for view, camera in photos]
    views[2] = mirrored_view(views[2], GENERIC)
    fit = fit_views(views, GENERIC, FitOptions())
    assert MIRRORED.format("2.png") in fit.notes
    assert [view.photo.name for view in fit.turned_over] == ["2.png"]
    np.testing.assert_array_equal(fit.turned_over[0].photo.pixels, photos[2][0].photo.pixels)
    first, third = (fit.photos[name].camera.R_cam_head for name in ("0.png", "2.png"))
    true = photos[2][1].R_cam_head @ photos[0][1].R_cam_head.T
    assert np.degrees(angle_between(third @ first.T, true)) < 2
