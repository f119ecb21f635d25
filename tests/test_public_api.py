"""The public names: few, all there, and cheap until they are used."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

import mien

HEAVY = ("numba", "cv2", "mediapipe", "scipy", "PIL", "av", "matplotlib", "pygltflib", "pxr")


def heavy_modules_after(statement: str) -> list[str]:
    """Which heavy packages a fresh interpreter holds after this statement."""
    program = f"{statement}\nimport sys\nprint(*(m for m in {HEAVY} if m in sys.modules))"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()[-1].split()


@pytest.mark.parametrize("name", mien.__all__)
def test_every_public_name_is_what_its_own_module_defines(name: str) -> None:
    item = getattr(mien, name)
    assert item.__name__ == name
    assert item.__module__.startswith("mien.")
    assert item.__doc__


def test_names_are_sorted_and_listed() -> None:
    assert sorted(mien.__all__) == mien.__all__
    assert set(mien.__all__) <= set(dir(mien))


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(str(mien.__file__)).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: node.module for node in imports for alias in node.names}
    assert sorted(homes) == mien.__all__
    assert homes == {name: f"mien.{home}" for name, home in mien._HOMES.items()}


def test_no_public_name_is_hidden_by_a_module_of_the_same_name() -> None:
    modules = {path.stem for path in Path(str(mien.__file__)).parent.iterdir()}
    assert not modules & set(mien.__all__)


def test_version() -> None:
    assert mien.__version__ == version("mien")


def test_an_unknown_name() -> None:
    with pytest.raises(AttributeError, match="module 'mien' has no attribute 'biuld'"):
        _ = mien.biuld  # type: ignore[attr-defined]


def test_importing_mien_loads_nothing_heavy() -> None:
    assert heavy_modules_after("import mien") == []
    assert heavy_modules_after("import mien\nmien.InputError") == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        *(
            [name, "--help"]
            for name in ("build", "render", "animate", "track", "examples", "synthesize")
        ),
    ],
)
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    assert heavy_modules_after(f"from mien.cli.main import main\nmain({arguments})") == []
