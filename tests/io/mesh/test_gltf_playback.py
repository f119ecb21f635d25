"""An animated .glb in three.js in a real browser."""

from __future__ import annotations

import base64
import io
import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from mien.head import Head
from mien.io.mesh.gltf import save_glb
from mien.io.mesh.head_animation import HeadAnimation
from mien.numeric.rotation import rotation_from_vector

HERE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Frame:
    influences: np.ndarray  # a row for each of the meshes that three.js makes of the primitives
    quaternion: np.ndarray
    position: np.ndarray
    picture: np.ndarray


@dataclass(frozen=True)
class Playback:
    meshes: list[dict[str, Any]]
    clips: list[dict[str, Any]]
    frames: list[Frame]
    looks: dict[str, np.ndarray]
    complaints: list[str]


@pytest.fixture
def play() -> Callable[[Path, list[float]], Playback]:
    """A .glb in three.js in Chromium, stopped at these times."""
    node, chromium = shutil.which("node"), shutil.which("chromium")
    installed = all(
        (HERE / "node_modules" / name).is_dir() for name in ("three", "playwright-core")
    )
    if node is None or not installed:
        pytest.skip("no three.js: run `npm ci` in tests/io")
    if chromium is None:
        pytest.skip("no chromium: run `apt-get install chromium`")

    def playback(path: Path, times: list[float]) -> Playback:
        command = [node, HERE / "play_gltf.cjs", path, chromium, *map(str, times)]
        run = subprocess.run(command, capture_output=True, text=True, timeout=120)
        assert run.returncode == 0, run.stderr
        report = json.loads(run.stdout)
        frames = [
            Frame(*(np.array(frame[key]) for key in ("influences", "quaternion", "position")), png)
            for frame in report["frames"]
            for png in [_picture(frame["png"])]
        ]
        looks = {name: _picture(png) for name, png in report["looks"].items()}
        return Playback(report["meshes"], report["clips"], frames, looks, report["complaints"])

    return playback


def _picture(png: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")).astype(float)


def test_three_js_plays_it_in_a_browser(
    small_head: Head,
    nod: HeadAnimation,
    tmp_path: Path,
    play: Callable[[Path, list[float]], Playback],
) -> None:
    save_glb(small_head, tmp_path / "head.glb", animation=nod)
    times = [0.0, 0.25, 0.4, 1.0, 1.75]
    found = play(tmp_path / "head.glb", times)
    assert found.complaints == []
    assert found.clips == [{"name": "nod", "duration": 2}]
    names = ["eyeLookUpLeft", "jawOpen", "tongueOut", "joy"]
    assert found.meshes == [{"targets": 4, "names": names}] * 2
    for time, frame in zip(times, found.frames, strict=True):
        expected = [
            np.interp(time, nod.times, nod.weights_of(names)[:, index])
            for index in range(len(names))
        ]
        np.testing.assert_allclose(frame.influences, [expected] * 2, atol=1e-4)
        np.testing.assert_allclose(frame.position, time * np.array([0.01, -0.02, 0.005]), atol=1e-7)
        # A turn at constant speed about one axis: three.js interpolates it exactly.
        turned = Rotation.from_quat(frame.quaternion).as_matrix()
        given = rotation_from_vector(time * np.pi * np.array([0.6, 0.8, 0.0]))
        np.testing.assert_allclose(turned, given, atol=1e-5)
    first, later = found.frames[0].picture, found.frames[3].picture
    assert np.abs(first - later).mean() > 2, "the picture stands still"


def test_the_head_that_ships_stands_upright_and_opens_its_mouth(
    generic: Head, tmp_path: Path, play: Callable[[Path, list[float]], Playback]
) -> None:
    jaw = HeadAnimation([0.0, 1.0, 2.0], ("jawOpen",), [[0.0], [1.0], [0.0]])
    save_glb(generic, tmp_path / "head.glb", animation=jaw)
    found = play(tmp_path / "head.glb", [0.0, 1.0])
    assert found.complaints == []
    assert all(mesh["names"] == list(generic.unit_names) for mesh in found.meshes)
    closed, open_ = (frame.picture for frame in found.frames)
    rows, columns = np.nonzero(np.abs(open_ - closed).max(axis=-1) > 20)
    assert len(rows) > 1000
    height, width, _ = closed.shape
    assert np.percentile(rows, 5) > 0.5 * height, "what opens lies in the lower half"
    assert abs(columns.mean() / width - 0.5) < 0.02, "and in the middle"


def test_three_js_shows_each_expressions_texture(
    small_head: Head,
    nod: HeadAnimation,
    tmp_path: Path,
    play: Callable[[Path, list[float]], Playback],
) -> None:
    textures = dict(small_head.textures)
    for name, color in (("atlas", (220, 30, 30)), ("joy", (30, 30, 220))):
        textures[name] = np.full_like(textures[name], color)
    head = replace(small_head, textures=textures)
    save_glb(head, tmp_path / "head.glb", lit=False, animation=nod)
    looks = play(tmp_path / "head.glb", [0.0]).looks
    assert list(looks) == ["neutral", "joy"]
    for name, color in (("neutral", (220, 30, 30)), ("joy", (30, 30, 220))):
        middle = looks[name][300:340, 220:260].reshape(-1, 3)
        np.testing.assert_allclose(middle, np.broadcast_to(color, middle.shape), atol=4)
