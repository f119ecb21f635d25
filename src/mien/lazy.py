"""Public names that are loaded when they are first used."""

from __future__ import annotations

# As typing's own, which is not imported: `import mien` takes a tenth of the time without it.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def public_names(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """What a package's `__init__` needs so that its public names are loaded on first use.

    The names are listed once, as imports in the stub `__init__.pyi` beside the package's
    `__init__.py`. Type checkers, editors and documentation tools read that file; so does the
    package itself, when it is first asked for a name. (lazy_loader's attach_stub reads it when the
    package is imported, and takes only names from inside the package.)

    Args:
        package: its `__name__`.
        file: its `__file__`.

    Returns:
        The package's `__getattr__`, which also knows `__all__`, and its `__dir__`, which lists the
        public names alone.
    """
    modules: dict[str, str] = {}

    def module_of() -> dict[str, str]:
        if not modules:
            modules.update(_imports_of(f"{file.removesuffix('.py')}.pyi"))
        return modules

    def get(name: str) -> Any:
        from importlib import import_module

        if name == "__all__":
            return names()
        # What Python itself asks of any package, such as `__path__`, is no public name.
        module = None if name.startswith("__") else module_of().get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if module == package:
            return import_module(f"{package}.{name}")
        return getattr(import_module(module), name)

    def names() -> list[str]:
        return sorted(module_of())

    return get, names


def _imports_of(stub: str) -> dict[str, str]:
    """Every name that a stub imports, and the module that it comes from."""
    import ast

    with open(stub, encoding="utf-8") as text:
        tree = ast.parse(text.read())
    imports = (node for node in tree.body if isinstance(node, ast.ImportFrom))
    return {alias.name: node.module or "" for node in imports for alias in node.names}
