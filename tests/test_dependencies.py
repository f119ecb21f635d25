"""What is installed is what pyproject.toml admits, and has what mien takes of it."""

from __future__ import annotations

import inspect
import tomllib
from importlib.metadata import packages_distributions, requires, version
from pathlib import Path

import pytest
from tools.lowest_versions import PYPROJECT, lowest_versions

PROJECT = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
BOUNDS = [
    *PROJECT["dependencies"],
    *PROJECT["optional-dependencies"]["usd"],
    *PROJECT["optional-dependencies"]["test"][1:],
]


def release(text: str) -> tuple[int, ...]:
    """As far as it is numbers: a release's letters count for nothing here."""
    return tuple(int(part) for part in text.split(".") if part.isdigit())


@pytest.mark.parametrize("requirement", BOUNDS)
def test_what_is_installed_is_between_versions_that_were_tried(requirement: str) -> None:
    name, _, bounds = requirement.partition(">=")
    lowest, _, first_untried = bounds.partition(",<")
    assert first_untried, "a major version that nobody tried must not come by itself"
    assert release(lowest) <= release(version(name)) < release(first_untried)


def test_one_opencv_the_one_that_mediapipe_wants() -> None:
    (ours,) = (name for name in PROJECT["dependencies"] if name.startswith("opencv"))
    theirs = [name for name in requires("mediapipe") or () if name.startswith("opencv")]
    assert theirs == [ours.partition(">=")[0]]
    assert packages_distributions()["cv2"] == theirs


def test_lowest_versions_are_read_from_pyproject() -> None:
    text = """
        [project]
        name = "mien"
        dependencies = ["a>=1.2,<2", "b-c>=3"]
        [project.optional-dependencies]
        usd = ["d>=4"]
        test = ["mien[usd]", "e[x]>=5.6.7,<6"]
    """
    assert lowest_versions(text) == ["a==1.2", "b-c==3", "d==4", "e==5.6.7"]
    with pytest.raises(ValueError, match=r"b: expected NAME>=VERSION"):
        lowest_versions(text.replace("b-c>=3", "b"))


def test_every_package_that_mien_imports_is_asked_for() -> None:
    """Directly, not because another package happens to bring it."""
    source = Path(__file__).parents[1] / "src" / "mien"
    imported = {
        line.split()[1].split(".")[0]
        for path in source.rglob("*.py")
        for line in map(str.strip, path.read_text(encoding="utf-8").splitlines())
        if line.startswith(("import ", "from ")) and " " in line
    }
    asked = {requirement.partition(">=")[0].lower().replace("-", "_") for requirement in BOUNDS}
    distributions = packages_distributions()
    for module in imported & set(distributions):
        names = {name.lower().replace("-", "_") for name in distributions[module]}
        brought = {"llvmlite", "mien", "click"}  # numba's and typer's own, of the version they want
        assert names & (asked | brought), module


def test_what_the_kernels_cache_takes_of_numba() -> None:
    """Names that Numba does not promise; `mien.numeric.kernels.jit` stands on them."""
    from numba.core.compiler import CompileResult
    from numba.core.dispatcher import Dispatcher

    for method in (Dispatcher.enable_caching, Dispatcher.compile):
        assert "self._cache" in inspect.getsource(method)
    assert callable(CompileResult._reduce)
    assert callable(CompileResult._rebuild)
