"""Drawn curves as points."""

from __future__ import annotations

import numpy as np
import pytest

from mien.errors import InputError
from mien.reconstruction.curves import epipolar_lines, match_curve, resample_curve


class TestArcLength:
    def test_quarter_points_of_a_corner(self):
        corner = [[0.0, 0], [2, 0], [2, 2]]
        np.testing.assert_allclose(
            resample_curve(corner, 5), [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2]]
        )

    def test_equal_steps_on_a_circle(self):
        angles = np.linspace(0, np.pi, 2001)
        circle = 50 * np.column_stack([np.cos(angles), np.sin(angles)])
        steps = np.linalg.norm(np.diff(resample_curve(circle, 9), axis=0), axis=1)
        np.testing.assert_allclose(steps, 100 * np.sin(np.pi / 16), rtol=1e-5)

    def test_given_fractions(self):
        line = [[0.0, 0], [10, 0]]
        np.testing.assert_allclose(resample_curve(line, [0.1, 0.9])[:, 0], [1, 9])

    def test_drawing_more_densely_changes_nothing(self, rng):
        curve = np.cumsum(rng.normal(size=(6, 2)), axis=0)
        dense = np.insert(curve, slice(1, None), (curve[1:] + curve[:-1]) / 2, axis=0)
        np.testing.assert_allclose(resample_curve(curve, 20), resample_curve(dense, 20))

    def test_repeated_points_count_once(self):
        curve = [[0.0, 0], [0, 0], [1, 0], [1, 0], [2, 0]]
        np.testing.assert_allclose(resample_curve(curve, 3)[:, 0], [0, 1, 2])

    @pytest.mark.parametrize("curve", [np.zeros((0, 2)), [[1.0, 2]], [[1.0, 2], [1, 2]]])
    def test_refuses_a_curve_that_is_a_point(self, curve):
        with pytest.raises(InputError, match="curve: expected two different points or more"):
            resample_curve(curve, 3)

    def test_refuses_bad_input(self):
        line = [[0.0, 0], [1, 0]]
        with pytest.raises(InputError, match="curve: expected finite numbers"):
            resample_curve([[0.0, 0], [np.nan, 0]], 3)
        with pytest.raises(InputError, match=r"curve: expected shape \(any, 2\)"):
            resample_curve(np.zeros((4, 3)), 3)
        with pytest.raises(InputError, match="fractions: expected numbers from 0 to 1"):
            resample_curve(line, [0.5, 1.5])
        with pytest.raises(InputError, match="fractions: expected one point or more, got 0"):
            resample_curve(line, 0)


@pytest.fixture
def two_cameras(make_scene):
    return make_scene(0, yaws=(-20, 25)).cameras


def upright_curve(count):
    """(count, 3) mm: a curve that crosses the epipolar lines of side-by-side cameras well."""
    u = np.linspace(0, 1, count)
    return np.column_stack([20 * np.sin(4 * u), -60 * u**1.5, 30 * np.cos(3 * u)])


class TestEpipolarGeometry:
    def test_images_of_a_point_lie_on_each_others_lines(self, make_scene):
        scene = make_scene(0, hidden=False)
        for a, b in ((0, 1), (4, 2)):
            lines = epipolar_lines(scene.image_points[a], scene.cameras[a], scene.cameras[b])
            off = (lines[:, :2] * scene.image_points[b]).sum(axis=1) + lines[:, 2]
            np.testing.assert_allclose(off, 0, atol=1e-7)
            np.testing.assert_allclose(np.linalg.norm(lines[:, :2], axis=1), 1)

    def test_finds_the_corresponding_points(self, two_cameras):
        reference, other = two_cameras
        places = upright_curve(9)
        drawn = other.project(upright_curve(2001))
        found = match_curve(reference.project(places), reference, drawn, other)
        assert found.matched[1:-1].all()
        off = np.linalg.norm(found.points - other.project(places), axis=1)
        assert off.max() < 0.05

    def test_beats_arc_length_where_perspective_shortens(self, two_cameras):
        reference, other = two_cameras
        places, drawn = upright_curve(9), other.project(upright_curve(2001))
        along = np.linalg.norm(np.diff(reference.project(upright_curve(2001)), axis=0), axis=1)
        fractions = np.append(0, np.cumsum(along))[:: 2000 // 8] / along.sum()
        by_length = resample_curve(drawn, fractions) - other.project(places)
        found = match_curve(reference.project(places), reference, drawn, other, fractions=fractions)
        by_lines = found.points - other.project(places)
        assert np.abs(by_lines).max() < 0.1 * np.abs(by_length).max()

    def test_a_curve_along_the_lines_falls_back_to_arc_length(self, two_cameras):
        reference, other = two_cameras
        ends = reference.center, other.center
        across = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        places = 60 * np.linspace(-1, 1, 7)[:, None] * across
        drawn = other.project(60 * np.linspace(-1, 1, 301)[:, None] * across)
        found = match_curve(reference.project(places), reference, drawn, other)
        assert not found.matched.any()
        np.testing.assert_allclose(found.points, resample_curve(drawn, 7))

    def test_of_several_crossings_the_orderly_ones_are_taken(self, two_cameras):
        """A curve that runs down and up again crosses every line twice."""
        reference, other = two_cameras

        def arch(count):
            u = np.linspace(0, np.pi, count)
            return np.column_stack([30 * np.cos(u), -50 * np.sin(u), 0 * u])

        places = arch(11)
        found = match_curve(reference.project(places), reference, other.project(arch(2001)), other)
        assert (np.diff(found.fractions) >= 0).all()
        off = np.linalg.norm(found.points - other.project(places), axis=1)
        assert np.median(off) < 0.05
        assert off[found.matched].max() < 0.1

    def test_a_wild_curve_stays_in_order(self, two_cameras, rng):
        reference, other = two_cameras
        drawn = other.project(upright_curve(40)) + 30 * rng.normal(size=(40, 2))
        found = match_curve(reference.project(upright_curve(9)), reference, drawn, other)
        assert (np.diff(found.fractions) >= 0).all()
        assert found.fractions.min() >= 0
        assert found.fractions.max() <= 1

    def test_one_camera_twice_tells_nothing(self, two_cameras):
        drawn = two_cameras[0].project(upright_curve(50))
        found = match_curve(
            two_cameras[0].project(upright_curve(5)), two_cameras[0], drawn, two_cameras[0]
        )
        assert not found.matched.any()
        np.testing.assert_allclose(found.points, resample_curve(drawn, 5))

    def test_refuses_bad_input(self, two_cameras):
        a, b = two_cameras
        points, curve = np.zeros((3, 2)), np.array([[0.0, 0], [1, 1]])
        with pytest.raises(InputError, match="curve: expected two different points or more, got 1"):
            match_curve(points, a, curve[:1], b)
        with pytest.raises(InputError, match="reference_points: expected finite numbers"):
            match_curve(points * np.nan, a, curve, b)
        with pytest.raises(InputError, match="fractions: expected numbers that do not fall"):
            match_curve(points, a, curve, b, fractions=[0.5, 0.2, 1.0])
