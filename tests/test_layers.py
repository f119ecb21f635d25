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


def module_imports(source: str) -> set[str]:
    """Modules whose code an import runs, and names that may be such; not what only types need.

    Imports inside functions count: they are how a cycle is hidden.
    """
    found = set()
    waiting: list[ast.AST] = [ast.parse(source)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            waiting.extend(node.orelse)
            continue
        waiting.extend(ast.iter_child_nodes(node))
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return found


def import_graph(sources: dict[str, str]) -> dict[str, set[str]]:
    """Of each module, those others that it imports; a package's own name is its `__init__`.

    A name that is taken from a module counts as that module; `mien` itself, whose names are loaded
    when they are asked for, is left out.
    """
    graph: dict[str, set[str]] = {}
    for module, source in sources.items():
        graph[module] = set()
        for name in module_imports(source):
            target = name if name in sources else name.rpartition(".")[0]
            if target in sources and target not in ("mien", module):
                graph[module].add(target)
    return graph


def import_cycle(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle, the first one again at the end; [] for none."""
    done: set[str] = set()

    def visit(module: str, path: list[str]) -> list[str]:
        if module in path:
            return [*path[path.index(module) :], module]
        if module not in done:
            for imported in sorted(graph[module]):
                if cycle := visit(imported, [*path, module]):
                    return cycle
            done.add(module)
        return []

    for module in sorted(graph):
        if cycle := visit(module, []):
            return cycle
    return []


def all_sources() -> dict[str, str]:
    """The text of every module of mien, by its dotted name."""
    sources = {}
    for path in SOURCE.rglob("*.py"):
        parts = ("mien", *path.relative_to(SOURCE).with_suffix("").parts)
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        sources[name] = path.read_text(encoding="utf-8")
    return sources


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert import_cycle(import_graph(all_sources())) == []


def test_a_circle_through_an_import_inside_a_function_is_found() -> None:
    sources = {
        "mien.a": "from mien.b import thing",
        "mien.b": "import mien.c",
        "mien.c": "def f():\n    from mien import a",
        "mien.d": "from mien.a import other",
    }
    assert import_cycle(import_graph(sources)) == ["mien.a", "mien.b", "mien.c", "mien.a"]


def test_an_import_for_types_alone_makes_no_circle() -> None:
    sources = {
        "mien.a": "from mien.b import thing",
        "mien.b": "if TYPE_CHECKING:\n    from mien.a import Other",
    }
    assert import_cycle(import_graph(sources)) == []


MAX_MODULES = 15


def test_no_folder_shows_more_modules_than_a_reader_takes_in() -> None:
    for folder in [SOURCE, *(path for path in SOURCE.rglob("*") if path.is_dir())]:
        modules = [path.stem for path in folder.glob("*.py") if path.stem != "__init__"]
        name = folder.relative_to(SOURCE).as_posix()
        assert len(modules) <= MAX_MODULES, f"{name}: {len(modules)} modules"


def test_no_two_public_classes_share_a_name() -> None:
    modules: dict[str, list[str]] = {}
    for module, source in all_sources().items():
        for node in ast.parse(source).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                modules.setdefault(node.name, []).append(module)
    shared = {name: found for name, found in modules.items() if len(found) > 1}
    assert not shared
