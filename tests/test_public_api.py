"""The public names: few, all there, and cheap until they are used."""

from __future__ import annotations

import ast
import pkgutil
import pydoc
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest

import mien

SOURCE = Path(str(mien.__file__)).parent
HEAVY = ("numba", "cv2", "mediapipe", "scipy", "PIL", "av", "matplotlib", "pygltflib", "pxr")


def heavy_modules_after(statement: str) -> list[str]:
    """Which heavy packages a fresh interpreter holds after this statement."""
    program = f"{statement}\nimport sys\nprint(*(m for m in {HEAVY} if m in sys.modules))"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()[-1].split()


SPACES = {name: getattr(mien, name) for name in mien.__all__ if (SOURCE / name).is_dir()}
PACKAGES = (mien, *SPACES.values())
NAMES = sorted(
    f"{package.__name__}.{name}"
    for package in PACKAGES
    for name in package.__all__
    if name not in SPACES
)


def test_there_is_a_namespace_for_every_subject() -> None:
    expected = {"animate", "capture", "io", "reconstruction", "render", "rig"}
    assert set(SPACES) == expected | {"synthesis", "texture", "track"}
    assert all(package.__doc__ for package in PACKAGES)


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_is_what_its_own_module_defines(name: str) -> None:
    item = pkgutil.resolve_name(name)
    assert item.__name__ == name.rpartition(".")[2]
    assert item.__module__.startswith("mien.")
    assert item.__doc__


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_names_are_sorted_and_completed(package: ModuleType) -> None:
    assert dir(package) == sorted(package.__all__) == package.__all__


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_type_checkers_see_every_name(package: ModuleType) -> None:
    """In a stub, what is imported under its own name once more is public; nothing else is."""
    tree = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text(encoding="utf-8"))
    imported = [
        alias for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names
    ]
    assert sorted(str(alias.asname) for alias in imported) == package.__all__
    assert all(alias.name == alias.asname for alias in imported)


def test_the_package_itself_holds_few_names() -> None:
    assert len(set(mien.__all__) - set(SPACES)) <= 24


def test_a_name_means_one_thing() -> None:
    """In whatever namespaces it is."""
    meanings: dict[str, object] = {}
    for name in NAMES:
        item = pkgutil.resolve_name(name)
        assert meanings.setdefault(name.rpartition(".")[2], item) is item


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_no_public_name_is_hidden_by_a_module_of_the_same_name(package: ModuleType) -> None:
    modules = {path.stem for path in Path(str(package.__file__)).parent.iterdir()}
    assert not modules & set(package.__all__) - set(SPACES)


def test_help_shows_the_names_of_a_namespace() -> None:
    shown = pydoc.plain(pydoc.render_doc(mien.track))
    assert "A head in a video, frame by frame" in shown
    assert "track_video(" in shown
    assert "class Track(" in shown


def test_the_examples_import_public_names_only() -> None:
    for script in sorted((Path(__file__).parents[1] / "examples").glob("*.py")):
        for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("mien"):
                public = pkgutil.resolve_name(str(node.module)).__all__
                assert {alias.name for alias in node.names} <= set(public), script


def test_version() -> None:
    assert mien.__version__ == version("mien")


def test_an_unknown_name() -> None:
    with pytest.raises(AttributeError, match="module 'mien' has no attribute 'biuld'"):
        _ = mien.biuld
    with pytest.raises(
        AttributeError, match=r"module 'mien\.track' has no attribute 'tarck_video'"
    ):
        _ = mien.track.tarck_video


def test_importing_mien_loads_nothing_heavy() -> None:
    assert heavy_modules_after("import mien") == []
    assert heavy_modules_after("import mien\nmien.InputError") == []
    assert (
        heavy_modules_after(f"import mien\nfor name in {sorted(SPACES)}: dir(getattr(mien, name))")
        == []
    )


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
