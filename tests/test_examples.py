"""The examples run from start to end, in their order, and leave what they promise."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


def test_examples_run_in_order(tmp_path: Path) -> None:
    assert len(EXAMPLES) >= 6
    for script in EXAMPLES:
        done = subprocess.run(
            [sys.executable, "-W", "error", script], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "example-head" / "report.html").is_file()
    assert (tmp_path / "example-head.glb").stat().st_size > 100_000
    assert len(list(tmp_path.glob("example-head-*.png"))) == 3
    for suffix in (".mp4", ".glb", ".csv"):
        assert (tmp_path / f"example-head-hello{suffix}").stat().st_size > 10_000
    for suffix in (".csv", ".json", ".mp4", ".glb"):
        assert (tmp_path / f"example-head-track{suffix}").stat().st_size > 300
    assert (tmp_path / "example-photos-examples" / "examples.json").is_file()
    assert (tmp_path / "example-photos-examples.png").stat().st_size > 10_000
    assert (tmp_path / "example-notebook.png").stat().st_size > 10_000
