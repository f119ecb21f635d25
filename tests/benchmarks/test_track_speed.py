from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks.track_speed import Ran, ping_pong, run

from mien.io.files.video import save_video


def test_a_clip_goes_forward_and_backward(tmp_path: Path) -> None:
    greys = (40, 90, 140, 190)
    save_video(tmp_path / "clip.mp4", (np.full((64, 64, 3), grey, np.uint8) for grey in greys), 25)
    shown = [frame.mean() for frame in ping_pong(tmp_path / "clip.mp4", (32, 32), 9)]
    np.testing.assert_allclose(shown, [40, 90, 140, 190, 140, 90, 40, 90, 140], atol=3)


def test_wide_pictures_hold_the_clip_in_the_middle(tmp_path: Path) -> None:
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:, 28:36] = 255
    save_video(tmp_path / "clip.mp4", [picture], 25)
    (wide,) = ping_pong(tmp_path / "clip.mp4", (160, 90), 1)
    assert wide.shape == (90, 160, 3)
    assert wide[:, 76:84].mean() > 230
    assert wide[:, 45:60].mean() < 20


def test_growth_is_from_early_to_late() -> None:
    at = np.linspace(0, 10, 1001)
    ran = Ran(10.0, 8.0, np.column_stack([at, 100 + 5 * at]))
    assert ran.growth_mb == pytest.approx(5 * 8, abs=0.2)
    assert ran.peak_mb == 150
    assert Ran(10.0, 8.0, np.column_stack([at, np.full(1001, 80.0)])).growth_mb == 0


def test_a_command_that_fails_says_so() -> None:
    with pytest.raises(subprocess.CalledProcessError):
        run([sys.executable, "-c", "raise SystemExit(3)"])
    ran = run([sys.executable, "-c", "import time; held = b'x' * 60_000_000; time.sleep(0.6)"])
    assert ran.seconds > 0.6
    assert 0 < ran.cpu < ran.seconds
    assert ran.peak_mb > 55
