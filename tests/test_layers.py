"""Data flows one way: a module imports only from its own layer and those above it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "mien"

# From the first stage to the last. Modules that share an entry may use each other.
ORDER = (
    ("errors", "lazy", "limits", "progress"),
    ("arrays", "reading"),
    ("expression_names",),
    ("mesh", "camera"),
    ("head",),
    ("numeric",),
    ("assets",),
    ("capture",),
    ("reconstruction",),
    ("texture",),
    ("rig",),
    ("render",),
    ("track",),
    ("synthesis",),
    ("animate",),
    ("io",),
    ("report",),
    ("pipelines",),
    ("cli",),
    ("__init__", "__main__"),
)
LEVEL = {name: level for level, names in enumerate(ORDER) for name in names}


def layer_of(module: str) -> str:
    """`mien.numeric.rbf` to `numeric`; the package itself to `__init__`."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def imported_layers(source: str) -> set[tuple[str, int]]:
    """The layers that a module's text imports from, with the line; imports in functions count."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        modules: list[str] = []
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module == "mien":
            modules = [f"mien.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = [node.module or ""]
        for module in modules:
            if module == "mien" or module.startswith("mien."):
                layer = layer_of(module)
                # `from mien import Head` takes a public name of the package itself.
                found.add((layer if layer in LEVEL else "__init__", node.lineno))
    return found


def violations(layer: str, source: str) -> list[str]:
    return [
        f"line {line}: {layer} imports {used}"
        for used, line in sorted(imported_layers(source), key=lambda item: item[1])
        if LEVEL[used] > LEVEL[layer]
    ]


@pytest.mark.parametrize(
    "path", sorted(SOURCE.rglob("*.py")), ids=lambda path: path.relative_to(SOURCE).as_posix()
)
def test_module_imports_only_from_earlier_layers(path: Path) -> None:
    layer = path.relative_to(SOURCE).with_suffix("").parts[0]
    assert layer in LEVEL, f"{layer} has no place in the order of layers"
    assert violations(layer, path.read_text(encoding="utf-8")) == []


def test_an_import_inside_a_function_counts() -> None:
    source = "def f():\n    from mien.io.mesh.gltf import write_glb\n"
    assert violations("numeric", source) == ["line 2: numeric imports io"]


def test_the_package_itself_is_the_last_layer() -> None:
    assert violations("cli", "from mien import Head") == ["line 1: cli imports __init__"]
    assert violations("cli", "from mien import camera") == []


def test_no_relative_imports() -> None:
    for path in SOURCE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        relative = [n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.level]
        assert not relative, f"{path}: line {relative[0].lineno}"
