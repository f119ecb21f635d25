"""The command line's manners, and `mien export`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from glb_file import Glb
from mien.errors import InputError
from mien.pipelines.build import BuildOptions
from terminal import Built, Mien


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".usdz"])
def test_export(suffix: str, built: Built, mien: Mien, tmp_path: Path) -> None:
    out = tmp_path / f"head{suffix}"
    ran = mien("export", built.folder, "-o", out, "--json")
    assert ran.json == {"output": str(out), "bytes": out.stat().st_size}
    assert out.stat().st_size > 100_000


def test_the_glb_holds_the_face_units(built: Built, mien: Mien, tmp_path: Path) -> None:
    out = tmp_path / "head.glb"
    mien("export", built.folder, "-o", out)
    data = out.read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    names = document["meshes"][0]["extras"]["targetNames"]
    assert len(names) == 52
    assert {"jawOpen", "eyeBlinkLeft", "mouthSmileRight"} <= set(names)


def test_the_glb_holds_the_expressions(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    out = tmp_path / "head.glb"
    mien("export", expressive, "-o", out)
    names = Glb(out.read_bytes()).json["meshes"][0]["extras"]["targetNames"]
    assert len(names) == 54
    assert {"joy", "anger"} <= set(names)


def test_an_obj_holds_one_expression(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    corners = []
    for name in ("neutral", "joy"):
        out = tmp_path / f"{name}.obj"
        assert mien("export", expressive, "-o", out, "--expression", name).status == 0
        lines = [line.split()[1:] for line in out.read_text().splitlines() if line.startswith("v ")]
        corners.append(np.array(lines, float))
    smile = np.linalg.norm(corners[1] - corners[0], axis=1)
    assert 5 < smile.max() < 30
    assert (tmp_path / "joy.png").read_bytes() != (tmp_path / "neutral.png").read_bytes()


@pytest.mark.parametrize(
    ("name", "expression", "message"),
    [
        ("a.obj", "joi", "expression: expected one of neutral, joy, anger, got joi"),
        ("a.glb", "joy", "a.glb: expected an .obj for joy alone, got .glb, which holds all"),
    ],
)
def test_an_expression_that_cannot_be_exported(
    name: str,
    expression: str,
    message: str,
    expressive: Path,
    mien: Mien,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    error = mien("export", expressive, "-o", name, "--expression", expression).error
    assert error == message
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_suffix_is_refused(built: Built, mien: Mien, tmp_path: Path) -> None:
    error = mien("export", built.folder, "-o", tmp_path / "head.fbx").error
    expected = "expected a name that ends in .glb, .obj or .usdz, got .fbx"
    assert error == f"{tmp_path / 'head.fbx'}: {expected}"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["biuld", "photos"], "No such command 'biuld'"),
        (["build"], "Missing "),
        (["build", "photos"], "Missing option '-o'"),
        (["build", "photos", "-o", "head", "--fill", "paint"], "Invalid value for '--fill'"),
        (["build", "photos", "-o", "head", "--curves", "bezier"], "Invalid value for '--curves'"),
        (["build", "photos", "-o", "head", "--kernel", "cubic"], "Invalid value for '--kernel'"),
        (["build", "photos", "-o", "head", "--texture-size", "7"], "Invalid value for '--texture"),
        (["build", "photos", "-o", "head", "--interpupillary-mm", "6"], "Invalid value for '--int"),
        (["build", "photos", "-o", "head", "--interpupillary-mm", "nan"], "Invalid value for '--i"),
        (["build", "photos", "-o", "head", "--frames", "0"], "Invalid value for '--frames'"),
        (["build", "photos", "-o", "head", "--expressions", "0"], "--expressions: expected a num"),
        (["animate", "take.json", "-o", "take.mp4"], "Missing option '--head'"),
    ],
)
def test_a_mistyped_command_is_one_line(arguments: list[str], message: str, mien: Mien) -> None:
    assert mien(*arguments).error.startswith(message)


def test_help_goes_to_stdout(mien: Mien) -> None:
    for arguments in (["--help"], ["build", "--help"]):
        ran = mien(*arguments)
        assert ran.status == 0
        assert ran.err == ""
        assert "Photo" in ran.out
    assert "timeline" in mien("animate", "--help").out


@pytest.mark.parametrize(
    ("given", "passed"), [((), None), (("none",), 0), (("None",), 0), (("3",), 3)]
)
def test_how_many_expressions_to_pick(
    given: tuple[str, ...], passed: int | None, mien: Mien, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[BuildOptions] = []

    def ask(source: object, folder: object, *, options: BuildOptions, **others: object) -> None:
        asked.append(options)
        raise InputError("x", "y", "z")

    monkeypatch.setattr("mien.pipelines.build.build_head_folder", ask)
    mien("build", "clip.mp4", "-o", "head", *(("--expressions", *given) if given else ()))
    assert [options.expressions for options in asked] == [passed]


def fail(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def stop(*arguments: object, **options: object) -> None:
        raise error

    monkeypatch.setattr("mien.pipelines.build.build_head_folder", stop)


def test_a_bug_is_one_line_too(mien: Mien, monkeypatch: pytest.MonkeyPatch) -> None:
    fail(monkeypatch, ZeroDivisionError("division by\nzero"))
    error = mien("build", "photos", "-o", "head").error
    assert error == ("internal error: ZeroDivisionError: division by zero (--debug shows where)")


@pytest.mark.parametrize("error", [ZeroDivisionError("0"), InputError("x", "y", "z")])
@pytest.mark.parametrize("place", [0, 1, 5])
def test_debug_shows_the_traceback(
    error: Exception, place: int, mien: Mien, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail(monkeypatch, error)
    arguments = ["build", "photos", "-o", "head", "--json"]
    arguments.insert(place, "--debug")
    with pytest.raises(type(error)):
        mien(*arguments)


def test_an_interrupted_command(mien: Mien, monkeypatch: pytest.MonkeyPatch) -> None:
    fail(monkeypatch, KeyboardInterrupt())
    ran = mien("build", "photos", "-o", "head")
    assert (ran.status, ran.out) == (130, "")


def test_a_message_of_several_lines_becomes_one(
    mien: Mien, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail(monkeypatch, InputError("a\nb.png", "one thing", "an\nother"))
    assert (
        mien("build", "photos", "-o", "head").error == "a b.png: expected one thing, got an other"
    )
