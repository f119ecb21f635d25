"""mien: photographs to a textured head.

The names below are loaded when they are first used, so that `import mien` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mien.assets.generic import load_generic_head
    from mien.build import Build, BuildOptions, build_head
    from mien.camera import Camera
    from mien.errors import EstimationError, FileFormatError, InputError, MienError
    from mien.formats.export import export_head
    from mien.formats.head_folder import load_head, save_head
    from mien.mesh import Mesh
    from mien.model.fit import FitOptions
    from mien.model.head import Head
    from mien.render.picture import render_head

__version__: str

__all__ = [
    "Build",
    "BuildOptions",
    "Camera",
    "EstimationError",
    "FileFormatError",
    "FitOptions",
    "Head",
    "InputError",
    "Mesh",
    "MienError",
    "build_head",
    "export_head",
    "load_generic_head",
    "load_head",
    "render_head",
    "save_head",
]

_HOMES = {
    "Build": "build",
    "BuildOptions": "build",
    "Camera": "camera",
    "EstimationError": "errors",
    "FileFormatError": "errors",
    "FitOptions": "model.fit",
    "Head": "model.head",
    "InputError": "errors",
    "Mesh": "mesh",
    "MienError": "errors",
    "build_head": "build",
    "export_head": "formats.export",
    "load_generic_head": "assets.generic",
    "load_head": "formats.head_folder",
    "render_head": "render.picture",
    "save_head": "formats.head_folder",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("mien")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"mien.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
