"""`build_head` from Python: what it gives, and what it passes on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.capture.source import Capture, CapturedView
from mien.errors import EstimationError
from mien.pipelines.build import Build, BuildOptions, build_head
from mien.reconstruction.fit import FitOptions
from mien.reconstruction.registration import NOTHING_SHARED
from mien.rig.expression_textures import extract_expression_textures
from mien.texture.extract import Texture
from mien.texture.surface import SurfaceMap
from people import camera, person, photographed

GENERIC = load_generic_head()
MARKS = [*GENERIC.points, *(f"{name}.3" for name in GENERIC.polylines)]
OPTIONS = BuildOptions(fit=FitOptions(rounds=1), texture_size=32)


def view(name: str, yaw: float, *, seed: int = 2, points: list[str] | None = None) -> CapturedView:
    return photographed(person(seed), camera(yaw), name=name, points=points or MARKS)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Photos come from `calls.capture`, textures are grey; both remember how they were asked."""
    seen = SimpleNamespace(capture=None, source=None, options={}, photos=[])

    def load(source: Path, **options: object) -> Capture:
        seen.source, seen.options = source, options
        return seen.capture

    def grey(
        mesh: object, cameras: list, photos: list, *, surface: SurfaceMap, **options: object
    ) -> Texture:
        seen.photos.append((len(cameras), [photo[0, 0, 0] for photo in photos], options["fill"]))
        shape = surface.mask.shape
        return Texture(np.zeros((*shape, 3), np.uint8), np.ones(shape), np.ones((len(cameras), 3)))

    monkeypatch.setattr("mien.pipelines.build.load_capture", load)

    def paint(mesh: object, photographed: dict, *others: object) -> object:
        seen.photographed = {
            name: [photo[0, 0, 0] for photo in item.photos] for name, item in photographed.items()
        }
        return extract_expression_textures(mesh, photographed, *others)

    monkeypatch.setattr("mien.pipelines.head_textures.extract_texture", grey)
    monkeypatch.setattr("mien.pipelines.head_textures.extract_expression_textures", paint)
    return seen


def test_a_head_of_one_expression(calls: SimpleNamespace) -> None:
    views = (view("a.png", -20), view("b.png", 20))
    calls.capture = Capture("Ann", {"neutral": views}, ("a.png: blurred",))
    result = build_head("photos", options=OPTIONS)
    assert isinstance(result, Build)
    head, fit = result.head, result.fits["neutral"]
    assert head.subject == "Ann"
    np.testing.assert_array_equal(head.mesh.vertices, fit.vertices)
    np.testing.assert_array_equal(head.uncertainty_mm, fit.uncertainty_mm)
    assert head.unit_names == GENERIC.unit_names
    assert set(head.textures) == {"atlas", "cylinder"}
    assert head.textures["atlas"].shape == (32, 32, 3)
    assert result.coverage.shape == (32, 32)
    assert [item.photo for item in head.views] == ["a.png", "b.png"]
    for item in head.views:
        photo = fit.photos[item.photo]
        assert item.camera is photo.camera
        assert item.rms_px == photo.rms_px
        assert item.points_used == len(photo.inliers)
        assert item.outliers == {m.name: m.rejection for m in photo.marks if m.rejection}
    assert result.notes == ("a.png: blurred", NOTHING_SHARED)


def test_options_reach_those_they_concern(calls: SimpleNamespace) -> None:
    calls.capture = Capture("Ann", {"neutral": (view("a.png", 0),)})
    build_head("photos", options=replace(OPTIONS, face=2, frames=3, expressions=4, fill="grow"))
    assert calls.source == "photos"
    assert calls.options["face"] == 2
    assert calls.options["frames"] == 3
    assert calls.options["expressions"] == 4
    assert {fill for _, _, fill in calls.photos} == {"grow"}


def test_expressions_have_shapes_and_textures_of_their_own(calls: SimpleNamespace) -> None:
    """With photos of the same names, told apart by their grey."""
    views = []
    for grey, seed in ((10, 2), (20, 3)):
        one = view("a.png", 0, seed=seed)
        pixels = np.full_like(one.photo.pixels, grey)
        views.append(replace(one, photo=replace(one.photo, pixels=pixels)))
    calls.capture = Capture("Ann", {"neutral": (views[0],), "joy": (views[1],)})
    result = build_head("photos", options=OPTIONS)
    assert [item.photo for item in result.head.views] == ["neutral/a.png", "joy/a.png"]
    assert set(result.head.textures) == {"atlas", "joy", "cylinder"}
    assert [photos for _, photos, _ in calls.photos] == [[10], [10]], "atlas and cylinder"
    assert calls.photographed == {"neutral": [10], "joy": [20]}
    shapes = [item.vertices for item in result.head.expressions.values()]
    assert np.abs(shapes[0] - shapes[1]).max() > 1
    assert not np.array_equal(result.head.mesh.vertices, shapes[1])


def test_a_photo_that_does_not_fit_is_named_in_the_notes(calls: SimpleNamespace) -> None:
    wrong = view("wrong.png", 0, points=MARKS[:3])
    views = (view("a.png", -20), wrong, view("b.png", 20))
    calls.capture = Capture("Ann", {"neutral": views})
    result = build_head("photos", options=OPTIONS)
    assert result.head.left_out == {"wrong.png": "shows 3 points, needs 6"}
    assert result.notes == ("wrong.png was left out: shows 3 points, needs 6", NOTHING_SHARED)
    assert {count for count, _, _ in calls.photos} == {2}


def test_an_expression_that_does_not_fit_is_named_in_the_notes(calls: SimpleNamespace) -> None:
    shown = {"neutral": (view("a.png", 0),), "joy": (view("b.png", 0, points=MARKS[:3]),)}
    calls.capture = Capture("Ann", shown)
    result = build_head("photos", options=OPTIONS)
    assert set(result.head.expressions) == {"neutral"}
    assert [item.photo for item in result.head.views] == ["neutral/a.png"]
    (note,) = [note for note in result.notes if "joy" in note]
    assert note.startswith("joy: left out: ")


def test_without_neutral(calls: SimpleNamespace) -> None:
    calls.capture = Capture("Ann", {"joy": (view("a.png", 0),)})
    with pytest.raises(EstimationError, match="photos: no photo in neutral shows a face"):
        build_head("photos", options=OPTIONS)


def test_progress_reaches_the_end_of_every_stage(calls: SimpleNamespace) -> None:
    calls.capture = Capture("Ann", {"neutral": (view("a.png", 0),)})
    told: list[tuple[str, int, int]] = []
    build_head("photos", options=OPTIONS, progress=lambda *step: told.append(step))
    calls.options["progress"](1, 1)
    stages = list(dict.fromkeys(stage for stage, _, _ in told))
    assert stages == ["Solving cameras and shape", "Extracting textures", "Finding faces"]
    for stage in stages:
        steps = [(done, total) for name, done, total in told if name == stage]
        assert steps == sorted(steps)
        assert steps[-1][0] == steps[-1][1]
