"""Several faces, cut ones, and names of expressions: the same words in every command."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import Photo
from mien.pipelines.examples import save_example_folder
from terminal import Built, Mien

EVERY = ("build", "examples", "synthesize", "synthesize, head")

Commands = dict[str, tuple[Any, ...]]


def save(path: Path, pixels: Array) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)
    return path


@pytest.fixture(scope="module")
def man(built: Built) -> Array:
    """James, whole."""
    with Image.open(built.source / "left.png") as image:
        return np.asarray(image.convert("RGB"))


@pytest.fixture(scope="module")
def cut(man: Array) -> Array:
    """James down to between mouth and chin."""
    with LandmarkDetector() as detector:
        points = detector.detect(Photo("man.png", Path("man.png"), man)).points
    return man[: int(points[:, 1].max() - 0.2 * np.ptp(points[:, 1]))]


@pytest.fixture(scope="module")
def example_folder(man: Array, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("faces")
    save(place / "photos" / "man.png", man)
    save_example_folder(place / "photos", place / "examples")
    return place / "examples"


@pytest.fixture
def commands(example_folder: Path, expressive: Path, tmp_path: Path) -> Commands:
    """What a photo, or a folder of photos, is put at the end of."""
    out = tmp_path / "out.png"
    return {
        "build": ("build", "-o", tmp_path / "head", "--texture-size", 64),
        "examples": ("examples", "-o", tmp_path / "set"),
        "synthesize": ("synthesize", example_folder, "-o", out, "--photo"),
        "synthesize, head": ("synthesize", expressive, "-o", out, "--photo"),
    }


@pytest.mark.usefixtures("untextured")
@pytest.mark.parametrize("name", EVERY)
def test_a_face_that_the_edge_cuts_is_told_of(
    name: str, commands: Commands, mien: Mien, cut: Array, man: Array, tmp_path: Path
) -> None:
    ran = mien(*commands[name], save(tmp_path / "a" / "cut.png", cut))
    assert ran.status == 0, ran.err
    said = [line for line in (ran.out + ran.err).splitlines() if "the edge cuts" in line]
    assert len(said) == 1
    assert "cut.png: the edge cuts the face, " in said[0]
    assert said[0].endswith(" of its 478 points lie outside of the picture: they are a guess")
    ran = mien(*commands[name], save(tmp_path / "b" / "whole.png", man))
    assert ran.status == 0
    assert "the edge" not in ran.out + ran.err


@pytest.mark.parametrize("name", EVERY[:3])
def test_a_face_of_which_there_are_fewer(
    name: str, commands: Commands, mien: Mien, man: Array, tmp_path: Path
) -> None:
    couple = np.concatenate([man, man[:, ::-1]], axis=1)
    photo = save(tmp_path / "photos" / "couple.png", couple)
    ran = mien(*commands[name], photo, "--face", 3)
    assert ran.status == 2
    error = ran.err.splitlines()[-1]
    assert error == "error: face: expected 1 to 2, the faces in couple.png, got 3"


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
@pytest.mark.parametrize("command", ["build", "examples"])
@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (("neutral", "mouth:wide"), "mouth:wide: expected the name of an expression, got ':' in"),
        (("neutral", "Joy", "joy"), "joy: expected another name than that of Joy, got the same"),
        (("neutral", "aux"), "aux: expected the name of an expression, got that of a device on"),
    ],
)
def test_names_are_refused_before_any_work(
    command: str,
    names: tuple[str, ...],
    problem: str,
    mien: Mien,
    man: Array,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in names:
        save(tmp_path / "photos" / name / "a.png", man)
    monkeypatch.setattr(LandmarkDetector, "detect", lambda *rest, **options: pytest.fail("work"))
    error = mien(command, tmp_path / "photos", "-o", tmp_path / "out").error
    assert error.startswith(f"{tmp_path / 'photos'}/{problem}")
    assert not (tmp_path / "out").exists()


def test_an_equals_sign_may_be_in_a_name(mien: Mien, man: Array, tmp_path: Path) -> None:
    for name in ("neutral", "a=b"):
        save(tmp_path / "photos" / name / "a.png", man)
    ran = mien("examples", tmp_path / "photos", "-o", tmp_path / "out")
    assert ran.status == 0, ran.err


def test_expressions_without_neutral_are_refused_before_any_work(
    mien: Mien, man: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path / "photos" / "joy" / "a.png", man)
    monkeypatch.setattr(LandmarkDetector, "detect", lambda *rest, **options: pytest.fail("work"))
    error = mien("build", tmp_path / "photos", "-o", tmp_path / "out").error
    assert error == f"{tmp_path / 'photos'}: there is no folder called neutral among its folders"
