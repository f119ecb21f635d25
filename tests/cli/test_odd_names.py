"""Names that are not UTF-8 or that steer terminals, and terminals that know ASCII only."""

from __future__ import annotations

import io
import json
import logging
import os
import shutil
import sys
from pathlib import Path

import pytest

from mien.cli.main import main
from mien.cli.printing import set_up_streams
from mien.cli.progress import terminal_progress
from mien.io.examples.example_folder import load_examples
from mien.io.head.head_folder import load_head
from terminal import Built, Mien

LATIN1 = os.fsdecode(b"J\xfcrgen")  # as Python has a name in Latin-1 where names are UTF-8
STEERING = "a\\b\n\x1b[2J"


@pytest.fixture
def oddly_named(james: Path) -> Path:
    """Two photos and their marks; what to read is in a folder with such a name, too."""
    for side, name in (("left", LATIN1), ("right", STEERING)):
        for folder, suffix in ((james, ".png"), (james / "annotations", ".json")):
            try:
                (folder / f"{side}{suffix}").rename(folder / f"{name}{suffix}")
            except OSError:
                pytest.skip("this file system takes no such names")
    return james.rename(james.with_name(f"photos {LATIN1}"))


def ascii_stream() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="strict")


def written(stream: io.TextIOWrapper) -> str:
    stream.flush()
    assert isinstance(stream.buffer, io.BytesIO)
    return stream.buffer.getvalue().decode("ascii")


def test_a_head_of_such_photos(
    oddly_named: Path, mien: Mien, tmp_path: Path, untextured: None
) -> None:
    head = tmp_path / f"head {LATIN1}"
    data = mien("build", oddly_named, "-o", head, "--texture-size", 64, "--json").json
    assert data["head"] == str(tmp_path / "head J") + "\\xfcrgen"
    made = load_head(head)
    assert made.subject == "photos J%FCrgen"
    assert {view.photo for view in made.views} == {"J%FCrgen.png", "a%5Cb%0A%1B[2J.png"}
    names = sorted(path.name for path in (head / "photos").iterdir())
    assert names == ["J%FCrgen.png", "a%5Cb%0A%1B[2J.png"]
    json.loads((head / "head.json").read_bytes().decode("utf-8"))


def test_examples_of_such_photos(oddly_named: Path, mien: Mien, tmp_path: Path) -> None:
    shutil.rmtree(oddly_named / "annotations")
    out = tmp_path / f"set {LATIN1}"
    ran = mien("examples", oddly_named, "-o", out)
    assert ran.status == 0, ran.err
    assert {example.source for example in load_examples(out).examples} <= {
        "J%FCrgen.png",
        "a%5Cb%0A%1B[2J.png",
    }


@pytest.mark.parametrize("kind", ["glb", "obj", "usdz"])
def test_files_of_such_names(built: Built, mien: Mien, tmp_path: Path, kind: str) -> None:
    place = tmp_path / f"{LATIN1}.{kind}"
    ran = mien("export", built.folder, "-o", place)
    assert ran.out == f"{tmp_path / 'J'}\\xfcrgen.{kind}\n"
    assert place.stat().st_size > 0
    if kind == "obj":
        assert b"mtllib " + os.fsencode(f"{LATIN1}.mtl") in place.read_bytes()


def test_terminals_that_know_ascii_only(
    built: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = ascii_stream()
    monkeypatch.setattr(sys, "stdout", out)
    place = tmp_path / "Jürgen.png"
    assert main(["render", str(built.folder), "-o", str(place), "--size", "32x40"]) == 0
    assert place.exists()
    assert written(out) == f"{tmp_path}/J\\xfcrgen.png\n".replace("/", os.sep)


def test_bars_on_terminals_that_know_ascii_only(monkeypatch: pytest.MonkeyPatch) -> None:
    err = ascii_stream()
    monkeypatch.setattr(sys, "stderr", err)
    set_up_streams()
    with terminal_progress(quiet=False) as progress:
        progress("Zähne", 1, 2)
    assert "Z\\xe4hne" in written(err)


def test_what_matplotlib_says_of_its_folders_stays_out(capfd: pytest.CaptureFixture[str]) -> None:
    set_up_streams()
    logging.getLogger("matplotlib").warning("created a temporary cache directory")
    assert capfd.readouterr().err == ""


def test_what_is_wrong_with_such_a_name_is_said(mien: Mien, tmp_path: Path) -> None:
    missing = tmp_path / (LATIN1 + "\x1b[2J")
    ran = mien("build", missing, "-o", tmp_path / "head")
    shown = f"{tmp_path / 'J'}\\xfcrgen\\x1b[2J"
    expected = "a photo, a video or a folder of photos"
    assert ran.error == f"{shown}: expected {expected}, got nothing there"


def test_nul_in_an_argument(mien: Mien) -> None:
    ran = mien("build", "a\0b", "-o", "head")
    assert ran.error == "arguments: expected text without NUL, got a\\x00b"
