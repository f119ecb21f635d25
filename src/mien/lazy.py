"""Public names that are loaded when they are first used."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any


def public_names(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """What a package's `__init__` needs so that its public names are loaded on first use.

    The names are listed once, as imports in the stub `__init__.pyi` beside the package's
    `__init__.py`. Type checkers, editors and documentation tools read that file; so does the
    package itself, when it is first asked for a name. (lazy_loader's attach_stub does the same
    when the package is imported, but takes only names from inside the package.)

    Args:
        package: its `__name__`.
        file: its `__file__`.

    Returns:
        The package's `__getattr__`, which also knows `__all__`, and its `__dir__`, which lists the
        public names alone.
    """

    @cache
    def homes() -> dict[str, str]:
        return _imports_of(f"{file.removesuffix('.py')}.pyi")

    def get(name: str) -> Any:
        if name == "__all__":
            return sorted(homes())
        # What Python itself asks of any package, such as `__path__`, is no public name.
        home = None if name.startswith("__") else homes().get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if home == package:
            return import_module(f"{package}.{name}")
        return getattr(import_module(home), name)

    def names() -> list[str]:
        return sorted(homes())

    return get, names


def _imports_of(stub: str) -> dict[str, str]:
    """Every name that a stub imports, and the module that it comes from."""
    import ast

    with open(stub, encoding="utf-8") as text:
        tree = ast.parse(text.read())
    imports = (node for node in tree.body if isinstance(node, ast.ImportFrom))
    return {alias.name: node.module or "" for node in imports for alias in node.names}
