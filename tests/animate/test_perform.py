"""Frames of a timeline, and cameras that stand for a moving head."""

from __future__ import annotations

import numpy as np
import pytest

from mien.animate.curves import Curve, constant
from mien.animate.perform import frame_times, moved_camera
from mien.animate.timeline import Timeline
from mien.errors import InputError
from mien.render.orbit import orbit_camera
from moments import moments


def test_frames_fill_the_duration() -> None:
    timeline = Timeline(10.0, fps=30)
    times = frame_times(timeline)
    assert len(times) == 300
    assert times[0] == 0
    assert times[-1] == pytest.approx(10 - 1 / 30)
    assert len(frame_times(timeline, 24)) == 240
    assert len(frame_times(Timeline(0.001))) == 1
    with pytest.raises(InputError, match="fps"):
        frame_times(timeline, 0)


def test_moments_follow_the_frames() -> None:
    curve = Curve([0.0, 1.0], [0.0, 1.0])
    timeline = Timeline(1.0, fps=10, tracks={"units.jawOpen": curve})
    found = list(moments(timeline))
    np.testing.assert_array_equal([moment.time for moment in found], frame_times(timeline))
    weights = [moment.state.units["jawOpen"] for moment in found]
    np.testing.assert_array_equal(weights, curve.at(frame_times(timeline)))


def test_a_moved_camera_sees_what_the_camera_sees_of_a_moved_head(rng: np.random.Generator) -> None:
    vertices = rng.normal(scale=60, size=(40, 3))
    camera = orbit_camera(0.3, 0.1, 0.05, width=300, height=400, vertices=vertices)
    names = ("yaw", "pitch", "roll", "x", "y", "z")
    pose = (0.4, -0.2, 0.15, 3.0, -7.0, 11.0)
    tracks = {f"head.{n}": constant(v) for n, v in zip(names, pose, strict=True)}
    moment = Timeline(1.0, tracks=tracks).at(0)
    moved = vertices @ moment.rotation.T + moment.translation
    seen = moved_camera(camera, moment).project(vertices)
    np.testing.assert_allclose(seen, camera.project(moved), atol=1e-9)
