from __future__ import annotations

import os

import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.networks import detector_model_path
from mien.capture.faces.mediapipe_face import (
    BLENDSHAPE_NAMES,
    FaceNetwork,
    _libraries_explained,
    _quiet_stderr,
    yaw_pitch,
)
from mien.errors import MienError


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str], faces: dict[str, Array]) -> None:
    with FaceNetwork(detector_model_path()) as network:
        assert len(network.faces(faces["left"])) == 1
    assert capfd.readouterr() == ("", "")


def test_other_messages_pass(capfd: pytest.CaptureFixture[str]) -> None:
    with _quiet_stderr():
        os.write(2, b"W0000 00:00:17.9 51 graph.cc:1] chatter\nE0000 00:00 true trouble\nplain\n")
    assert capfd.readouterr().err == "E0000 00:00 true trouble\nplain\n"


def test_messages_before_an_error_pass(capfd: pytest.CaptureFixture[str]) -> None:
    def fail() -> None:
        os.write(2, b"F0000 the reason\n")
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"), _quiet_stderr():
        fail()
    assert capfd.readouterr().err == "F0000 the reason\n"


def test_without_a_place_for_temporary_files(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refused() -> None:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr("tempfile.TemporaryFile", refused)
    with _quiet_stderr():
        os.write(2, b"said\n")
    assert capfd.readouterr().err == "said\n"


def test_blendshape_names_are_the_networks(faces: dict[str, Array]) -> None:
    with FaceNetwork(detector_model_path()) as network:
        mediapipe = network._mediapipe
        image = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=faces["left"])
        scores = network._network.detect(image).face_blendshapes[0]
    assert tuple(score.category_name for score in scores) == BLENDSHAPE_NAMES


@pytest.mark.parametrize(
    ("error", "library"),
    [
        (
            OSError("libGLESv2.so.2: cannot open shared object file: No such file"),
            r"libGLESv2\.so\.2",
        ),
        (ImportError("libGL.so.1: cannot open shared object file"), r"libGL\.so\.1"),
    ],
)
def test_missing_system_library(error: Exception, library: str) -> None:
    message = (
        rf"^the face detector needs {library}, which .* `apt-get install libegl1 libgles2 libgl1`"
    )
    with pytest.raises(MienError, match=message), _libraries_explained():
        raise error


def test_other_import_errors_stay() -> None:
    with pytest.raises(ImportError, match="numpy"), _libraries_explained():
        raise ImportError("No module named 'numpy'")


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (0.5, 0.2), (-0.7, -0.3)])
def test_yaw_pitch_of_known_rotations(yaw: float, pitch: float) -> None:
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    # About x, y up: a positive angle takes z, the nose, downwards.
    tip = np.array(
        [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
    )
    assert yaw_pitch(np.diag([1.0, -1.0, -1.0]) @ turn @ tip) == pytest.approx((yaw, pitch))


@pytest.mark.parametrize("roll", [-3.1, -np.pi / 2, -0.4, 0.7, np.pi / 2, np.pi])
def test_yaw_and_pitch_do_not_depend_on_how_the_picture_lies(roll: float) -> None:
    cos, sin = np.cos(roll), np.sin(roll)
    in_plane = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    turn = np.array([[np.cos(0.6), 0, np.sin(0.6)], [0, 1, 0], [-np.sin(0.6), 0, np.cos(0.6)]])
    tip = np.array([[1, 0, 0], [0, np.cos(0.2), -np.sin(0.2)], [0, np.sin(0.2), np.cos(0.2)]])
    upright = np.diag([1.0, -1.0, -1.0]) @ turn @ tip
    assert yaw_pitch(in_plane @ upright) == pytest.approx((0.6, 0.2))
