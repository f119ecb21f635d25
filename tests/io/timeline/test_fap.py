"""Facial animation parameters: known displacements give known numbers, on faces of any size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mien.animate.channels import head_rotation
from mien.assets.generic import load_generic_head
from mien.errors import EstimationError, InputError
from mien.io.timeline.fap import FapMeter, measure_fapu, save_fap
from mien.io.timeline.fap_table import COUNT, MEASURED, PARAMETERS

HEAD = load_generic_head()
NEUTRAL = np.array(HEAD.mesh.vertices)
BY_NAME = {item.name: item.number - 1 for item in PARAMETERS}


def unit(name: str, weight: float = 1.0) -> np.ndarray:
    return NEUTRAL + weight * HEAD.unit_offsets[HEAD.unit_names.index(name)]


def test_units_are_distances_in_the_face() -> None:
    fapu = measure_fapu(NEUTRAL)
    assert pytest.approx(63, abs=0.5) == fapu.ES
    corners = [NEUTRAL[HEAD.points[f"{side}_mouth_corner"], 0] for side in ("left", "right")]
    assert pytest.approx(corners[0] - corners[1]) == fapu.MW
    lip = NEUTRAL[HEAD.vertex_of("upper_lip_inner.3"), 1]
    eyes = (0.0 + 0.0) / 2
    assert pytest.approx(eyes - lip, abs=0.5) == fapu.ENS + fapu.MNS
    assert 7 < fapu.IRISD < 13


def test_a_face_at_rest_has_no_parameters() -> None:
    assert not FapMeter.of(NEUTRAL).read(NEUTRAL, np.eye(3)).any()


def test_an_open_jaw_gives_the_displacement_of_the_chins_lowest_point() -> None:
    meter = FapMeter.of(NEUTRAL)
    offset = HEAD.unit_offsets[HEAD.unit_names.index("jawOpen")]
    drop = -offset[HEAD.vertex_of("left_jaw.0"), 1]
    values = meter.read(unit("jawOpen", 0.5))
    assert values[BY_NAME["open_jaw"]] == round(512 * drop / meter.fapu.MNS) > 100
    lip = offset[HEAD.vertex_of("lower_lip_inner.3"), 1]
    assert values[BY_NAME["raise_b_midlip"]] == round(512 * lip / meter.fapu.MNS) < -100


def test_one_mm_is_1024_over_the_unit() -> None:
    meter = FapMeter.of(NEUTRAL)
    for item in PARAMETERS:
        moved = NEUTRAL.copy()
        moved[:, item.axis] += item.sign
        expected = 0 if item.relative_to else round(1024 / getattr(meter.fapu, item.unit))
        assert meter.read(moved)[item.number - 1] == expected, item.name


def test_parameters_that_go_one_way_are_never_negative() -> None:
    meter = FapMeter.of(NEUTRAL)
    up_and_back = meter.read(NEUTRAL + np.array([0.0, 1.0, -1.0]))
    down = meter.read(NEUTRAL - np.array([0.0, 1.0, 0.0]))
    for name in ("open_jaw", "thrust_jaw"):
        assert up_and_back[BY_NAME[name]] == 0
    for name in ("lift_l_cheek", "lift_r_cheek"):
        assert down[BY_NAME[name]] == 0


def test_larger_faces_have_the_same_parameters() -> None:
    small, large = FapMeter.of(NEUTRAL), FapMeter.of(1.7 * NEUTRAL)
    for name in ("jawOpen", "mouthSmileLeft", "eyeBlinkRight", "browInnerUp", "eyeLookDownLeft"):
        np.testing.assert_array_equal(small.read(unit(name)), large.read(1.7 * unit(name)))


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("eyeBlinkLeft", "close_t_l_eyelid"),
        ("eyeBlinkRight", "close_t_r_eyelid"),
        ("mouthSmileLeft", "raise_l_cornerlip"),
        ("mouthSmileRight", "stretch_r_cornerlip_o"),
        ("browInnerUp", "raise_l_i_eyebrow"),
        ("browOuterUpRight", "raise_r_o_eyebrow"),
        ("browDownLeft", "squeeze_l_eyebrow"),
        ("cheekPuff", "puff_r_cheek"),
        ("cheekSquintLeft", "lift_l_cheek"),
        ("jawForward", "thrust_jaw"),
        ("jawRight", "shift_jaw"),
        ("mouthPucker", "push_b_lip"),
        ("tongueOut", "thrust_tongue_tip"),
    ],
)
def test_units_move_their_parameters(name: str, parameter: str) -> None:
    assert FapMeter.of(NEUTRAL).read(unit(name))[BY_NAME[parameter]] > 10


def test_closed_lids_meet() -> None:
    values = FapMeter.of(NEUTRAL).read(unit("eyeBlinkLeft"))
    both = values[BY_NAME["close_t_l_eyelid"]] + values[BY_NAME["close_b_l_eyelid"]]
    assert both == pytest.approx(1024, rel=0.15)


def test_head_and_eyes_turn_by_their_angles() -> None:
    mesh = HEAD.mesh
    moved = NEUTRAL.copy()
    ball = np.unique(mesh.triangles[mesh.part == mesh.part_names.index("left_eyeball")])
    centre = moved[ball].mean(axis=0)
    moved[ball] = (moved[ball] - centre) @ head_rotation(0.2, -0.1, 0).T + centre + [0, 0, 1.0]
    meter = FapMeter.of(NEUTRAL)
    values = meter.read(moved, head_rotation(0.3, 0, 0) @ head_rotation(0, 0.2, 0))
    assert values[48 - 1] == 20_000, "pitch down"
    assert values[49 - 1] == 30_000, "yaw to the left"
    assert values[50 - 1] == 0
    assert meter.read(NEUTRAL, head_rotation(0, 0, 0.1))[50 - 1] == 10_000, "roll to the right"
    # Yaw first, then pitch about a fixed axis: for one of the other order a little different.
    assert values[23 - 1] == pytest.approx(20_000, abs=150)
    assert values[25 - 1] == pytest.approx(-10_000, abs=250)
    assert values[27 - 1] == round(1024 / meter.fapu.ES)
    assert not values[[23, 25, 27]].any(), "the right eye stays"


def test_the_file_says_what_it_holds(tmp_path: Path) -> None:
    meter = FapMeter.of(NEUTRAL)
    frames = [meter.read(unit("jawOpen", weight)) for weight in (0.0, 0.5, 1.0)]
    assert save_fap(tmp_path / "my take.fap", iter(frames), 25) == 3
    lines = (tmp_path / "my take.fap").read_text().splitlines()
    assert lines[0] == "2.1 my_take 25 3"
    assert len(lines) == 7
    for index, frame in enumerate(frames):
        mask = [int(bit) for bit in lines[1 + 2 * index].split()]
        number, *values = (int(text) for text in lines[2 + 2 * index].split())
        assert number == index
        assert len(mask) == COUNT
        assert {i + 1 for i, bit in enumerate(mask) if bit} == MEASURED
        assert values == [value for value, bit in zip(frame, mask, strict=True) if bit]
    assert set(range(1, 69)) - MEASURED == {1, 2, 29, 30, 46, 47}


def test_bad_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a.fap: expected a whole number.*got 29.97"):
        save_fap(tmp_path / "a.fap", [np.zeros(68)], 29.97)
    with pytest.raises(InputError, match="at least one frame to write"):
        save_fap(tmp_path / "a.fap", [], 25)
    with pytest.raises(InputError, match=r"neutral: expected shape"):
        FapMeter.of(np.zeros((4, 3)))
    with pytest.raises(EstimationError, match=r"IRISD0 = 0.00 mm"):
        measure_fapu(np.zeros_like(NEUTRAL))
    assert not list(tmp_path.iterdir())
