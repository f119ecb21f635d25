"""The stopwatch, the memory mark, and how figures stand beside a peer's."""

from __future__ import annotations

import time

import numpy as np
import pytest
from benchmarks.stages import Run, Stages, peak_mb

from benchmarks import build


def test_laps_share_out_the_time() -> None:
    begun = time.perf_counter()
    stages = Stages()
    for name in ("a", "b", "a"):
        stages.lap(name)
    assert list(stages.seconds) == ["a", "b"]
    assert 0 <= sum(stages.seconds.values()) <= time.perf_counter() - begun


def test_the_peak_rises_with_what_is_held_and_stays() -> None:
    before = peak_mb()
    # More than has been held so far, whatever that was.
    held = np.ones(int((before + 32) * 2**20) // 8)
    with_it = peak_mb()
    del held
    assert with_it >= before + 32
    assert peak_mb() == pytest.approx(with_it, abs=1)


MIEN = Run(dict.fromkeys((*build.TO_FILE, build.WRITING), 2.0), 800.0)
EOS = Run(dict.fromkeys(("start", "load", "fit", "texture", "combine", "write"), 1.0), 400.0)


def cells(table: str, name: str) -> list[str]:
    (row,) = (line for line in table.splitlines() if line.startswith(f"| {name}"))
    return [cell.strip() for cell in row.strip("|").split("|")][1:]


def test_both_sides_and_their_ratio() -> None:
    table = build.table(build.Result(MIEN, EOS, {"mien": 6.0, "eos": 4.0, "eos_mean": 8.0}, {}))
    assert cells(table, "**photos to") == ["10", "6", "1.67"]
    assert cells(table, "with mien's time") == ["10", "8", "1.25"]
    assert cells(table, "texture") == ["2", "2", "1"]
    assert cells(table, "**peak memory") == ["800", "400", "2"]
    assert cells(table, "landmarks off, one head") == ["6", "8", "0.75"]
    assert "true head" not in table


def test_without_eos_the_table_says_so() -> None:
    table = build.table(build.Result(MIEN, None, {"mien": 6.0}, {"mien": 0.5}))
    assert "eos-py (not installed)" in table
    assert cells(table, "**photos to") == ["10", "-", "-"]
    assert cells(table, "face off the true head") == ["0.5", "-", "-"]


def test_the_same_head_has_no_surface_error() -> None:
    vertices = build.load_generic_head().mesh.vertices
    turned = 1.3 * vertices @ np.diag([-1.0, 1.0, -1.0]) + [5, 6, 7]
    assert build._surface_error(turned, vertices) == pytest.approx(0, abs=1e-9)
