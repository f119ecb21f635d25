"""Subregions: weights sum to 1, blend by eq. (7) on skin, end hard at eyes and lips."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mien.assets
from documents import put
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.assets.subregions import Subregions, default_subregions, load_subregion_drawing
from mien.errors import FileFormatError, InputError

SIZE = (300, 400)
SCALE, CENTRE = 200.0, np.array([150.0, 130.0])


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


@pytest.fixture(scope="module")
def points(layout: FeatureLayout) -> np.ndarray:
    return layout.template * SCALE + CENTRE


@pytest.fixture(scope="module")
def subregions(layout: FeatureLayout, points: np.ndarray) -> Subregions:
    return default_subregions(layout, points, SIZE)


def at(subregions: Subregions, place: np.ndarray) -> dict[str, float]:
    column, row = np.floor(place).astype(int)
    weights = subregions.fades[row, column]
    return {n: float(s) for n, s in zip(subregions.names, weights, strict=True) if s > 0}


def test_there_are_14_with_the_teeth_last(subregions: Subregions) -> None:
    assert len(subregions.names) == len(set(subregions.names)) == 14
    assert subregions.names[-1] == "teeth"
    assert subregions.fades.shape == (400, 300, 14)
    assert subregions.fades.dtype == np.float32


def test_weights_sum_to_one_on_the_face_and_to_zero_far_off(
    layout: FeatureLayout, points: np.ndarray, subregions: Subregions
) -> None:
    sums = subregions.fades.sum(axis=2)
    assert sums.max() <= 1 + 1e-6
    assert subregions.fades.min() >= 0
    contour = [n for n in layout.names if "jaw" in n or "temple" in n or "hairline" in n]
    columns, rows = np.floor(points).astype(int).T
    within = np.array([name not in contour for name in layout.names])
    np.testing.assert_allclose(sums[rows, columns][within], 1, atol=1e-6)
    assert sums[rows, columns].min() > 0.45  # Half on the outline, which runs around them.
    assert len(contour) == 13
    assert sums[-1].max() == 0
    assert sums[:, 0].max() == sums[:, -1].max() == 0
    steps = np.abs(np.diff(sums, axis=1)).max()  # It ends softly: over 0.06 times 200 px.
    assert steps < 0.1


@pytest.mark.parametrize(
    ("region", "names"),
    [
        ("forehead", ["forehead", "left_forehead.0"]),
        ("right_cheek", ["right_cheek.2"]),
        ("chin", ["chin"]),
        ("nose", ["nose_tip"]),
        ("left_brow", ["left_brow_upper.2", "left_brow_lower.1"]),
        ("teeth", ["upper_teeth", "lower_teeth"]),
    ],
)
def test_points_lie_in_their_subregions(
    layout: FeatureLayout, points: np.ndarray, subregions: Subregions, region: str, names: list[str]
) -> None:
    weights = at(subregions, points[[layout.index(n) for n in names]].mean(axis=0))
    assert weights == {region: pytest.approx(1)}
    members = subregions.members[subregions.names.index(region)]
    assert {layout.index(name) for name in names} <= set(members.tolist())


def test_skin_blends_linearly_half_on_the_border(
    layout: FeatureLayout, points: np.ndarray, subregions: Subregions
) -> None:
    """Eq. (7) along the row between a cheek and the chin."""
    row = int(points[layout.index("lower_lip_inner"), 1])
    line = subregions.fades[row, : int(CENTRE[0])]
    cheek, chin = (line[:, subregions.names.index(n)] for n in ("right_cheek", "chin"))
    between = (cheek > 0.01) & (chin > 0.01)
    np.testing.assert_allclose((cheek + chin)[between], 1, atol=1e-5)
    slopes = np.diff(chin[between])
    assert 8 <= between.sum() <= 15  # 0.06 x 200 px; the border is not quite upright
    assert (slopes > 0).all()
    assert np.ptp(slopes) < 0.06  # Pixels make it a little uneven.


@pytest.mark.parametrize(
    ("inside", "names"),
    [
        (["right_eye"], ["right_eye_inner", "right_upper_eyelid.1", "right_lower_eyelid.1"]),
        (["lips", "teeth"], ["upper_lip_outer", "lower_lip_outer", "left_mouth_corner"]),
    ],
)
def test_eyes_and_outer_lips_have_hard_borders(
    subregions: Subregions, inside: list[str], names: list[str]
) -> None:
    """No pixel is shared between what is inside and what is outside."""
    within = [subregions.names.index(name) for name in inside]
    weights = subregions.fades[..., within].sum(axis=2)
    assert set(np.unique(np.round(weights, 5)).tolist()) == {0.0, 1.0}


def test_lips_and_teeth_blend(subregions: Subregions) -> None:
    teeth = subregions.fades[..., -1]
    lips = subregions.fades[..., subregions.names.index("lips")]
    assert ((teeth > 0.1) & (lips > 0.1)).any()


def test_borders_avoid_where_wrinkles_run(
    layout: FeatureLayout, points: np.ndarray, subregions: Subregions
) -> None:
    """Across the forehead, between the brows, along the fold from nose to mouth: one subregion."""

    def alone(names: list[str]) -> set[str]:
        ends = points[[layout.index(name) for name in names]]
        steps = np.linspace(0, 1, 9)[:, None]
        lines = [a + steps * (b - a) for a, b in pairwise(ends)]
        owners = [at(subregions, place) for place in np.vstack(lines)]
        assert all(max(weights.values()) > 0.99 for weights in owners)
        return {max(weights, key=lambda name: weights[name]) for weights in owners}

    assert alone(["right_forehead.1", "right_forehead.0", "forehead", "left_forehead.1"]) == {
        "forehead"
    }
    assert alone(["right_brow_upper.0", "glabella", "left_brow_upper.0"]) == {"forehead"}
    assert alone(["left_nasolabial.0", "left_nasolabial.1"]) == {"left_cheek"}


def test_members_of_both_sides_are_mirror_images_and_all_points_have_a_place(
    layout: FeatureLayout, subregions: Subregions
) -> None:
    members = dict(zip(subregions.names, subregions.members, strict=True))
    for name in ("cheek", "lids", "brow", "eye"):
        mirrored = set(layout.mirror[members[f"right_{name}"]].tolist())
        assert mirrored == set(members[f"left_{name}"].tolist())
    assert set(np.concatenate(subregions.members).tolist()) == set(range(134))
    eye = {layout.names[i] for i in members["right_eye"]}
    assert len(eye) == 10
    assert all("eye" in name or name == "right_pupil" for name in eye)
    assert layout.index("right_pupil") in members["right_lids"]


def test_members_do_not_depend_on_the_person(
    layout: FeatureLayout, points: np.ndarray, subregions: Subregions, rng: np.random.Generator
) -> None:
    other = default_subregions(layout, points + rng.normal(0, 2, points.shape), SIZE)
    for one, same in zip(subregions.members, other.members, strict=True):
        np.testing.assert_array_equal(one, same)


def test_bad_calls_are_refused(layout: FeatureLayout, points: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"standard_points: expected shape \(134, 2\)"):
        default_subregions(layout, points[:-1], SIZE)
    with pytest.raises(InputError, match="size: expected a width and height"):
        default_subregions(layout, points, (0, 300))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("layout", to="ibug68"), "layout: expected 'zhang134', found 'ibug68'"),
        (put("groups", to=None), "groups: expected an object, found null"),
        (put("groups", "skin", to=0), "groups.skin: expected a number between 0 and 1, found 0"),
        (put("regions", to=[]), "regions: expected at least one"),
        (put("regions", 2, "name", to="left_cheek"), r"regions\[2\]: 'left_cheek' appears twice"),
        (put("regions", 1, "mirror_of", to="nose"), "mirror_of: no subregion 'nose' before"),
        (put("regions", 0, "group", to="hair"), "right_cheek.group: unknown group 'hair'"),
        (put("regions", 1, "group", to=[1]), "left_cheek.group: expected"),
        (put("regions", 0, "also", to="chin"), "right_cheek.also: expected a list of points"),
        (put("regions", 0, "also", to=["nos"]), "right_cheek.also: unknown point 'nos'"),
        (put("regions", 0, "corners", 1, to=3), r"right_cheek.corners\[1\]: expected an object"),
        (put("regions", 0, "corners", 1, to={"nos": 1}), r"corners\[1\]: unknown point 'nos'"),
        (put("regions", 0, "corners", 1, to={"chin": 0.5}), "shares that sum to 1, found 0.5"),
        (
            put("regions", 0, "corners", 1, to={"chin": 10**400, "menton": 1 - 10**400}),
            r"right_cheek.corners\[1\]: expected a finite number, found inf",
        ),
        (put("regions", 0, "corners", to=[]), "right_cheek.corners: expected at least 3, found 0"),
    ],
)
def test_an_error_in_a_drawing_is_one_line(
    tmp_path: Path, layout: FeatureLayout, change: Callable[[Any], None], message: str
) -> None:
    shipped = Path(mien.assets.__file__).parent / "data" / "zhang134_subregions.json"
    document = json.loads(shipped.read_text(encoding="utf-8"))
    change(document)
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(document))
    with pytest.raises(FileFormatError, match=message) as raised:
        load_subregion_drawing(layout, path)
    assert "\n" not in str(raised.value)


def test_a_users_drawing_is_used(layout: FeatureLayout, points: np.ndarray) -> None:
    drawing = load_subregion_drawing(layout)
    whole = replace(
        drawing,
        names=("face",),
        groups=("skin",),
        corners=drawing.corners[:1],
        blends=(0.06,),
        extra_points=drawing.extra_points[:1],
    )
    subregions = default_subregions(layout, points, SIZE, drawing=whole)
    assert subregions.names == ("face",)
    assert len(subregions.members[0]) > 50


def test_a_region_without_points_is_refused(layout: FeatureLayout, points: np.ndarray) -> None:
    """A speck of the frame, off the face."""
    drawing = load_subregion_drawing(layout)
    corner = np.eye(1, drawing.corners[0].shape[1], len(layout.names))
    bare = replace(
        drawing,
        names=("speck", *drawing.names[1:]),
        corners=(np.repeat(corner, 3, axis=0), *drawing.corners[1:]),
        extra_points=(np.arange(0), *drawing.extra_points[1:]),
    )
    with pytest.raises(InputError, match="members of speck: expected indices of points, one at"):
        default_subregions(layout, points, (400, 400), drawing=bare)
