"""OpenFace-style CSV: its columns, its signs, its action units."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mien.assets.generic import load_generic_head
from mien.camera import FRONTAL
from mien.errors import InputError
from mien.head import Expression, Head
from mien.io.live.live_link import LOOK_RANGE
from mien.io.tracks.openface_csv import (
    ACTION_UNITS,
    action_units,
    gaze_vectors,
    pose_angles,
    save_openface,
)
from mien.rig.gaze import EYE_LOOK_UNITS
from mien.rig.state import Gaze
from mien.rig.unit_decomposition import units_from_state
from mien.track.state import Layout
from tracks import LAYOUT, random_state, random_track, track_of

HEADER = (
    "frame,face_id,timestamp,confidence,success,gaze_0_x,gaze_0_y,gaze_0_z,gaze_1_x,gaze_1_y,"
    "gaze_1_z,gaze_angle_x,gaze_angle_y,pose_Tx,pose_Ty,pose_Tz,pose_Rx,pose_Ry,pose_Rz,AU01_r,"
    "AU02_r,AU04_r,AU05_r,AU06_r,AU07_r,AU09_r,AU10_r,AU12_r,AU14_r,AU15_r,AU17_r,AU20_r,AU23_r,"
    "AU25_r,AU26_r,AU45_r,AU01_c,AU02_c,AU04_c,AU05_c,AU06_c,AU07_c,AU09_c,AU10_c,AU12_c,AU14_c,"
    "AU15_c,AU17_c,AU20_c,AU23_c,AU25_c,AU26_c,AU28_c,AU45_c"
)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_columns_and_rows(tmp_path: Path, rng: np.random.Generator) -> None:
    track = random_track(rng)
    assert save_openface(tmp_path / "a.csv", track) == 9
    assert (tmp_path / "a.csv").read_text().splitlines()[0] == HEADER
    rows = rows_of(tmp_path / "a.csv")
    for number, (row, frame) in enumerate(zip(rows, track.frames, strict=True), 1):
        assert int(row["frame"]) == number
        assert float(row["timestamp"]) == pytest.approx(frame.time, abs=1e-6)
        assert row["success"] == str(int(frame.state is not None))
        assert all(np.isfinite([float(cell) for cell in row.values()]))
        if frame.state is None:
            assert not any(float(cell) for cell in list(row.values())[3:])
            continue
        assert float(row["confidence"]) == pytest.approx(frame.seen, abs=1e-6)
        place = [float(row[f"pose_T{axis}"]) for axis in "xyz"]
        np.testing.assert_allclose(place, frame.state.t_cam_head, atol=1e-6)
        assert float(row["AU26_r"]) == pytest.approx(5 * frame.state.units[0], abs=1e-5)
        assert float(row["AU45_r"]) == pytest.approx(2.5 * frame.state.units[1], abs=1e-5)


def test_angles_are_openfaces(rng: np.random.Generator) -> None:
    """Rx Ry Rz in the camera's axes, of a head whose own axes are the camera's at rest."""
    state = random_state(rng)
    about_x, about_y, about_z = (
        Rotation.from_euler(axis, angle).as_matrix()
        for axis, angle in zip("xyz", pose_angles(state.R_cam_head), strict=True)
    )
    np.testing.assert_allclose(about_x @ about_y @ about_z @ FRONTAL, state.R_cam_head, atol=1e-12)


def test_signs_of_angles() -> None:
    """A head that tips up has a negative Rx, one that turns to its right a positive Ry."""
    nose = np.array([0, 0, 1])
    up, right = (Rotation.from_euler(a, s).as_matrix() for a, s in (("x", -0.2), ("y", -0.3)))
    assert (up @ nose)[1] > 0
    np.testing.assert_allclose(pose_angles(FRONTAL @ up), (-0.2, 0, 0), atol=1e-12)
    assert (right @ nose)[0] < 0
    np.testing.assert_allclose(pose_angles(FRONTAL @ right), (0, 0.3, 0), atol=1e-12)


def test_eyes_that_look_at_the_camera_look_along_minus_z() -> None:
    np.testing.assert_allclose(gaze_vectors(FRONTAL, Gaze(), {}), [[0, 0, -1]] * 2)
    turned = FRONTAL @ Rotation.from_euler("y", 0.3).as_matrix()
    np.testing.assert_allclose(gaze_vectors(turned, Gaze(-0.3), {}), [[0, 0, -1]] * 2, atol=1e-12)


def test_gaze_angles_grow_to_the_pictures_right_and_down(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    looks = ((0.2, 0.0), (0.0, -0.1))
    states = [replace(random_state(rng), R_cam_head=FRONTAL, gaze=np.array(look)) for look in looks]
    save_openface(tmp_path / "a.csv", track_of(states, rng))
    left, down = rows_of(tmp_path / "a.csv")
    assert float(left["gaze_angle_x"]) == pytest.approx(0.2, abs=1e-6)
    assert float(left["gaze_angle_y"]) == 0
    assert float(down["gaze_angle_y"]) == pytest.approx(0.1, abs=1e-6)


def test_eye_0_is_the_pictures_leftmost() -> None:
    """The subject's right eye, which looks at the nose."""
    first, second = gaze_vectors(FRONTAL, Gaze(), {"eyeLookInRight": 0.5})
    np.testing.assert_allclose(first, (np.sin(LOOK_RANGE / 2), 0, -np.cos(LOOK_RANGE / 2)))
    np.testing.assert_allclose(second, (0, 0, -1))
    up = gaze_vectors(FRONTAL, Gaze(0, 0.1), {unit: 1 for unit in EYE_LOOK_UNITS if "Up" in unit})
    np.testing.assert_allclose(np.arctan2(-up[:, 1], -up[:, 2]), LOOK_RANGE + 0.1)


def test_action_units_are_made_of_face_units() -> None:
    known = set(load_generic_head().unit_names)
    assert all(unit in known for members in ACTION_UNITS.values() for unit in members)
    assert set(action_units({}).values()) == {0.0}
    found = action_units({"mouthSmileLeft": 1.0, "mouthSmileRight": 0.5, "browInnerUp": 2.0})
    assert found["AU12"] == 3.75
    assert found["AU01"] == 5.0
    assert action_units({"browInnerUp": -0.3})["AU01"] == 0.0


def test_lips_part_with_the_jaw_unless_they_are_held_together() -> None:
    assert action_units({"jawOpen": 0.4})["AU25"] == 2.0
    assert action_units({"jawOpen": 0.4, "mouthClose": 0.4})["AU25"] == 0.0
    lower = {"mouthLowerDownLeft": 0.6, "mouthLowerDownRight": 0.6}
    assert action_units(lower)["AU25"] == 3.0


def test_presence_starts_at_a_trace(tmp_path: Path, rng: np.random.Generator) -> None:
    states = [replace(random_state(rng), units=np.array([jaw, 0.0])) for jaw in (0.19, 0.21)]
    save_openface(tmp_path / "a.csv", track_of(states, rng))
    assert [row["AU26_c"] for row in rows_of(tmp_path / "a.csv")] == ["0", "1"]


def test_photographed_expressions_count_by_their_units(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    generic = load_generic_head()
    joy = Expression(generic.mesh.vertices, units={"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8})
    head = Head(
        subject="nobody",
        mesh=generic.mesh,
        expressions={"neutral": Expression(generic.mesh.vertices), "joy": joy},
        uncertainty_mm=np.ones(len(generic.mesh.vertices)),
        unit_names=generic.unit_names,
        unit_offsets=generic.unit_offsets,
    )
    layout = Layout(("mouth",), ("neutral", "joy"))
    state = replace(random_state(rng, layout), weights=np.array([[0.5, 0.5]]))
    track = track_of([state], rng, layout=layout)
    save_openface(tmp_path / "a.csv", track, units_of=lambda state: units_from_state(head, state))
    assert float(rows_of(tmp_path / "a.csv")[0]["AU12_r"]) == pytest.approx(2.0)


def test_an_empty_track_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    with pytest.raises(InputError, match="at least one frame to write"):
        save_openface(tmp_path / "a.csv", track_of([], rng, layout=LAYOUT))
    assert not list(tmp_path.iterdir())


def test_the_docs_table_is_the_codes() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "track-files.md"
    rows = re.findall(r"^\| (AU\d\d) \|.*\| ([\w, ]+?)(?:;.*)? \|$", page.read_text(), re.MULTILINE)
    assert {name: tuple(units.split(", ")) for name, units in rows} == dict(ACTION_UNITS)
