from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC
from mien.arrays import Array
from mien.errors import InputError
from mien.rig.regions import ENCLOSING_REGIONS, MASK_NAMES, check_masks, default_masks

DEFAULT = default_masks(GENERIC)
WHOLE = {
    name: DEFAULT[f"left_{half}"] + DEFAULT[f"right_{half}"]
    for name, half in (("mouth", "mouth"), ("eyes", "eye"), ("forehead", "forehead"))
}
COUNT = len(GENERIC.mesh.vertices)


def skin_of(region: str) -> Array:
    skin = GENERIC.mesh.vertices_of("skin")
    return skin[GENERIC.regions[region][skin] > 0.5]


def lines(*names: str) -> list[tuple[str, ...]]:
    """The polylines of these names on the left and on the right."""
    return [tuple(f"{side}_{name}" for name in names) for side in ("left", "right")]


def test_a_partition_of_the_face() -> None:
    assert tuple(DEFAULT) == MASK_NAMES
    for mask in DEFAULT.values():
        assert mask.shape == (COUNT,)
        assert mask.min() == 0
        assert 0.9 < mask.max() <= 1
    total = sum(DEFAULT.values())
    assert total.max() <= 1 + 1e-9
    np.testing.assert_array_equal(total[skin_of("scalp")] < 1, True)
    np.testing.assert_allclose(total[skin_of("neck")], 0, atol=0.5)


@pytest.mark.parametrize("half", ["mouth", "eye", "forehead"])
def test_left_mirrors_right(half: str) -> None:
    left, right = DEFAULT[f"left_{half}"], DEFAULT[f"right_{half}"]
    np.testing.assert_allclose(left[GENERIC.mirror], right, atol=1e-9)
    x = GENERIC.mesh.vertices[:, 0]
    assert not left[x < -6].any()
    assert not right[x > 6].any()


def test_left_gives_way_to_right_without_a_step() -> None:
    """Over the 12 mm around the midline; neighbours differ by no more than their distance says."""
    x = GENERIC.mesh.vertices[:, 0]
    inside = np.flatnonzero(WHOLE["mouth"] > 0.999)
    share = DEFAULT["left_mouth"][inside]
    order = np.argsort(x[inside])
    assert (np.diff(share[order]) >= -1e-9).all()
    middle = np.abs(x[inside]) < 1e-6
    assert middle.any()
    np.testing.assert_allclose(share[middle], 0.5, atol=1e-9)
    steps = np.diff(share[order]) / np.maximum(np.diff(x[inside][order]), 1e-6)
    assert steps.max() <= 1.5 / 12 + 1e-6


@pytest.mark.parametrize("names", lines("eyebrow_upper", "eyebrow_lower"))
def test_no_border_runs_through_a_brow(names: tuple[str, ...]) -> None:
    for name in names:
        assert WHOLE["forehead"][list(GENERIC.polylines[name])].min() >= 0.9


@pytest.mark.parametrize(
    ("region", "names"),
    [
        ("mouth", ("upper_lip_outer", "upper_lip_inner", "lower_lip_inner", "lower_lip_outer")),
        *(("mouth", names) for names in lines("nostril")),
        *(("eyes", names) for names in lines("upper_eyelid", "lower_eyelid")),
    ],
)
def test_no_border_runs_through_lips_nostrils_or_lids(region: str, names: tuple[str, ...]) -> None:
    for name in names:
        for other, mask in WHOLE.items():
            along = mask[list(GENERIC.polylines[name])]
            np.testing.assert_allclose(along, other == region, atol=0.05, err_msg=name)


@pytest.mark.parametrize(
    ("region", "behind"), [("mouth", "lips"), ("mouth", "mouth_cavity"), ("eyes", "eye_socket")]
)
def test_surfaces_behind_lips_and_lids_belong_to_their_regions(region: str, behind: str) -> None:
    for name, mask in WHOLE.items():
        np.testing.assert_allclose(mask[skin_of(behind)], name == region, atol=0.05)


@pytest.mark.parametrize(
    ("region", "parts"),
    [
        ("eyes", ("left_eyeball", "right_eyeball", "lashes")),
        ("mouth", ("upper_teeth", "lower_teeth", "tongue")),
    ],
)
def test_eyes_teeth_and_tongue_belong_to_one_region(region: str, parts: tuple[str, ...]) -> None:
    for name, mask in WHOLE.items():
        np.testing.assert_allclose(mask[GENERIC.mesh.vertices_of(*parts)], name == region)


def test_each_eyeball_belongs_to_its_side() -> None:
    for side in ("left", "right"):
        ball = GENERIC.mesh.vertices_of(f"{side}_eyeball")
        np.testing.assert_allclose(DEFAULT[f"{side}_eye"][ball], 1)


def test_every_region_lies_in_those_that_contain_it() -> None:
    assert set(MASK_NAMES) <= set(ENCLOSING_REGIONS)
    for region, around in ENCLOSING_REGIONS.items():
        assert region == "face" or around[-1] == "face"
        for index, name in enumerate(around):
            assert ENCLOSING_REGIONS[name] == around[index + 1 :]


def test_masks_that_overlap_are_scaled_down() -> None:
    masks = {"left_mouth": np.full(4, 1.0), "left_eye": np.array([0.0, 0.5, 1.0, 1.0])}
    checked = check_masks(masks, 4)
    assert tuple(checked) == MASK_NAMES
    np.testing.assert_allclose(checked["left_mouth"], [1, 1 / 1.5, 0.5, 0.5])
    np.testing.assert_allclose(checked["left_eye"], [0, 0.5 / 1.5, 0.5, 0.5])
    assert not checked["right_eye"].any()


def test_masks_that_fit_stay_as_they_are() -> None:
    for name, mask in check_masks(DEFAULT, COUNT).items():
        np.testing.assert_allclose(mask, DEFAULT[name], atol=1e-12)


@pytest.mark.parametrize(
    ("masks", "message"),
    [
        ({"chin": np.zeros(4)}, "regions: expected names of left_mouth, .*, got chin"),
        ({"mouth": np.zeros(4)}, "regions: expected names of left_mouth, .*, got mouth"),
        ({"left_eye": np.zeros(3)}, r"region left_eye: expected shape \(4\), got shape \(3,\)"),
        ({"left_eye": np.full(4, 1.2)}, "region left_eye: expected values from 0 to 1, got 1.2"),
        ({"left_eye": np.full(4, -0.1)}, "region left_eye: expected values from 0 to 1, got -0.1"),
        ({"left_eye": np.full(4, np.nan)}, "region left_eye: expected finite"),
    ],
)
def test_bad_masks_are_refused(masks: dict[str, Array], message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_masks(masks, 4)
