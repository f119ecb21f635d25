"""The layout of feature points: mirrored exactly, whole in its sets, unfolded on its template."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from documents import put
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.generic import load_generic_head
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS
from mien.errors import FileFormatError, InputError

LEFT_EYE = (
    *("left_eye_inner", "left_eye_outer"),
    *(f"left_upper_eyelid.{i}" for i in range(4)),
    *(f"left_lower_eyelid.{i}" for i in range(3)),
)


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


def test_there_are_134_points_in_21_sets(layout: FeatureLayout) -> None:
    assert layout.name == "zhang134"
    assert len(layout.names) == len(set(layout.names)) == 134
    assert [len(level) for level in layout.sets] == [1, 4, 16]
    assert [len(level) for level in layout.set_names] == [1, 4, 16]


def test_the_mirror_is_an_involution_that_swaps_sides(layout: FeatureLayout) -> None:
    assert (layout.mirror[layout.mirror] == np.arange(134)).all()
    for name, other in zip(layout.names, layout.mirror, strict=True):
        swapped = name.replace("right_", "*").replace("left_", "right_").replace("*", "left_")
        assert layout.names[other] == swapped


def test_the_template_is_symmetric_and_one_wide(layout: FeatureLayout) -> None:
    np.testing.assert_allclose(
        layout.template[layout.mirror], layout.template * [-1, 1], atol=1.1e-5
    )
    assert np.ptp(layout.template[:, 0]) == pytest.approx(1)
    assert layout.template[layout.index("left_eye_outer"), 0] > 0
    assert layout.template[layout.index("chin"), 1] > layout.template[layout.index("nose_tip"), 1]


def test_every_point_is_an_affine_combination_of_landmarks(layout: FeatureLayout) -> None:
    np.testing.assert_allclose(layout.landmark_weights.sum(axis=1), 1, atol=1e-12)
    assert (layout.landmark_weights >= 0).all()
    assert np.linalg.matrix_rank(layout.landmark_weights) >= 128  # Teeth come from the lips.


def test_pupils_are_the_detectors_irises_in_all_sets_of_eyes(layout: FeatureLayout) -> None:
    for side, landmark in (("right", RIGHT_IRIS), ("left", LEFT_IRIS)):
        index = layout.index(f"{side}_pupil")
        np.testing.assert_array_equal(layout.landmark_weights[index], np.eye(478)[landmark])
        sets = [
            name
            for names, level in zip(layout.set_names, layout.sets, strict=True)
            for name, members in zip(names, level, strict=True)
            if index in members
        ]
        assert sets == ["whole_face", f"{side}_eye_region", f"{side}_eyelids"]


def test_mirrored_landmarks_give_mirrored_points(layout: FeatureLayout) -> None:
    """The mixes of both sides are each other's: the generic head is symmetric."""
    head = load_generic_head()
    landmarks = head.landmark_positions(head.mesh.vertices)[:, :2]
    points = layout.from_landmarks(landmarks)
    np.testing.assert_allclose(points[layout.mirror], points * [-1, 1], atol=0.1)


def test_every_set_is_reached_from_every_other(layout: FeatureLayout) -> None:
    """[Zhang 2006] section 10: points that sets share carry motion from level to level."""
    assert len(layout.sets[0][0]) == 134
    for level in (1, 2):
        held = np.unique(np.concatenate(layout.sets[level]))
        assert len(held) == 134, [n for i, n in enumerate(layout.names) if i not in held]
    reached, fresh = set(), {(2, 15)}
    while fresh:
        level, number = fresh.pop()
        reached.add((level, number))
        for near in {level - 1, level + 1} & {0, 1, 2}:
            for other, members in enumerate(layout.sets[near]):
                shared = np.isin(members, layout.sets[level][number]).any()
                if shared and (near, other) not in reached:
                    fresh.add((near, other))
    assert len(reached) == 21


def test_sets_of_both_sides_are_mirror_images(layout: FeatureLayout) -> None:
    for names, sets in zip(layout.set_names, layout.sets, strict=True):
        drawn = dict(zip(names, map(set, sets), strict=True))
        for name, members in drawn.items():
            partner = name.replace("right_", "left_")
            assert drawn[partner] == (
                {int(layout.mirror[i]) for i in members} if partner != name else drawn[name]
            )


def test_triangles_cover_the_template_once_and_alike_on_both_sides(layout: FeatureLayout) -> None:
    places = np.vstack([layout.template, layout.template_frame])
    a, b, c = places[layout.triangles].transpose(1, 0, 2)
    areas = np.cross(np.c_[b - a, np.zeros(len(a))], np.c_[c - a, np.zeros(len(a))])[:, 2] / 2
    assert (areas > 1e-4).all()
    x, y = layout.template_frame.T
    hull = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    assert areas.sum() == pytest.approx(hull, rel=1e-4)
    assert set(layout.triangles.ravel()) == set(range(len(places)))
    mirror = np.append(layout.mirror, 134 + (-np.arange(len(x))) % len(x))
    triangles = {frozenset(t) for t in layout.triangles.tolist()}
    assert {frozenset(mirror[list(t)].tolist()) for t in triangles} == triangles


@pytest.mark.parametrize(
    "line",
    [
        ["right_eye_inner", *(f"right_upper_eyelid.{i}" for i in range(4)), "right_eye_outer"],
        ["left_eye_inner", *(f"left_lower_eyelid.{i}" for i in range(3)), "left_eye_outer"],
        [
            "upper_lip_outer",
            *(f"right_upper_lip_outer.{i}" for i in range(3)),
            "right_mouth_corner",
        ],
        *(["left_pupil", corner] for corner in LEFT_EYE),
        ["lower_lip_inner", *(f"left_lower_lip_inner.{i}" for i in range(2))],
        ["menton", *(f"left_jaw.{i}" for i in range(3)), "left_temple"],
    ],
)
def test_drawn_lines_are_edges(layout: FeatureLayout, line: list[str]) -> None:
    edges = {frozenset((int(t[i]), int(t[i - 1]))) for t in layout.triangles for i in range(3)}
    indices = [layout.index(name) for name in line]
    assert all(frozenset(pair) in edges for pair in pairwise(indices))


def test_the_frame_follows_the_head_and_no_expression(layout: FeatureLayout) -> None:
    turn = 80 * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    points = layout.template @ turn.T + [300, 200]
    np.testing.assert_allclose(layout.frame(points), layout.template_frame @ turn.T + [300, 200])
    moved = points.copy()
    moved[layout.index("menton")] += [3, 40]
    moved[layout.index("left_brow_upper.1")] -= [0, 12]
    np.testing.assert_array_equal(layout.frame(moved), layout.frame(points))


def test_unknown_points_are_answered_with_close_names(layout: FeatureLayout) -> None:
    with pytest.raises(InputError, match=r"such as left_chin.*got left_chinn"):
        layout.index("left_chinn")
    with pytest.raises(InputError, match=r"landmarks: expected shape \(478, 2\)"):
        layout.from_landmarks(np.zeros((468, 2)))
    with pytest.raises(InputError, match="points: expected finite"):
        layout.frame(np.full((134, 2), np.nan))


def _stored() -> dict[str, Any]:
    import mien.assets

    path = Path(mien.assets.__file__).parent / "data" / "zhang134.json"
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("format", to="other"), "format: expected 'mien feature points', found 'other'"),
        (put("version", to=2), "version: 2 was written by a newer mien"),
        (put("points", to=3), "points: expected a list, found a number"),
        (put("points", 1, to=[]), r"points\[1\]: expected an object"),
        (put("points", 1, "name", to="right_brow_upper.0"), "'right_brow_upper.0' appears twice"),
        (put("points", 8, "mirror", to="nose"), "mirror: unknown point 'nose'"),
        (put("points", 8, "mirror", to="chin"), "right_eye_inner.mirror: its counterpart 'chin'"),
        (put("points", 3, "template", to=[1]), "template: expected numbers of shape"),
        (put("points", 8, "landmarks", to={"478": 1}), "landmarks: unknown point '478'"),
        (
            put("points", 8, "landmarks", to={"4": "x"}),
            "right_eye_inner.landmarks: expected a num",
        ),
        (put("points", 8, "template", to=[10**400, 0]), "template: expected numbers of shape"),
        (put("points", 8, "landmarks", to={"4": 0.9}), "shares that sum to 1, found 0.9"),
        (put("sets", 1, to=[]), r"sets\[1\]: expected an object of lists of points"),
        (put("sets", 1, "nose_region", to=["x"]), r"sets\[1\].nose_region: unknown point 'x'"),
        (put("sets", to=[{"a": ["chin"]}, {"b": ["menton"]}]), r"sets\[1\].b: shares no point"),
        (put("sets", to=[{"a": ["chin"]}]), "sets: 'right_brow_upper.0' belongs to none"),
        (put("triangles", 0, to=[0, 1, 150]), "triples of whole numbers from 0 to 149"),
        (put("triangles", 0, to=[0, 1]), "triples of whole numbers from 0 to 149"),
        (put("rigid", to=["chin"]), "rigid: expected at least 2 points"),
        (put("frame", 0, to=[0, float("nan")]), "frame: expected finite numbers"),
    ],
)
def test_an_error_in_a_layout_is_one_line(
    tmp_path: Path, change: Callable[[Any], None], message: str
) -> None:
    document = _stored()
    change(document)
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(document))
    with pytest.raises(FileFormatError, match=message) as raised:
        load_feature_layout(path)
    assert str(raised.value).startswith(str(path))
    assert "\n" not in str(raised.value)


def test_files_that_are_no_json_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a readable file"):
        load_feature_layout(tmp_path / "none.json")
    (tmp_path / "bad.json").write_bytes(b"\xff{")
    with pytest.raises(FileFormatError, match="expected JSON in UTF-8"):
        load_feature_layout(tmp_path / "bad.json")
    (tmp_path / "list.json").write_text("[1]")
    with pytest.raises(FileFormatError, match="expected an object, found a list"):
        load_feature_layout(tmp_path / "list.json")
