"""mien: photographs to a textured head that performs.

The names below are loaded when they are first used, so that `import mien` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mien.animate.timeline import Timeline
    from mien.app.animate import Take, animate_head
    from mien.assets.generic import load_generic_head
    from mien.build import Build, BuildOptions, build_head
    from mien.camera import Camera
    from mien.errors import EstimationError, FileFormatError, InputError, MienError
    from mien.expressions.rig import Rig
    from mien.expressions.state import FaceState, Gaze
    from mien.formats.export import export_head
    from mien.formats.head_folder import load_head, save_head
    from mien.formats.timeline_file import load_performance
    from mien.mesh import Mesh
    from mien.model.fit import FitOptions
    from mien.model.head import Head
    from mien.render.picture import HeadRenderer, render_head

__version__: str

__all__ = [
    "Build",
    "BuildOptions",
    "Camera",
    "EstimationError",
    "FaceState",
    "FileFormatError",
    "FitOptions",
    "Gaze",
    "Head",
    "HeadRenderer",
    "InputError",
    "Mesh",
    "MienError",
    "Rig",
    "Take",
    "Timeline",
    "animate_head",
    "build_head",
    "export_head",
    "load_generic_head",
    "load_head",
    "load_performance",
    "render_head",
    "save_head",
]

_HOMES = {
    "Build": "build",
    "BuildOptions": "build",
    "Camera": "camera",
    "EstimationError": "errors",
    "FaceState": "expressions.state",
    "FileFormatError": "errors",
    "FitOptions": "model.fit",
    "Gaze": "expressions.state",
    "Head": "model.head",
    "HeadRenderer": "render.picture",
    "InputError": "errors",
    "Mesh": "mesh",
    "MienError": "errors",
    "Rig": "expressions.rig",
    "Take": "app.animate",
    "Timeline": "animate.timeline",
    "animate_head": "app.animate",
    "build_head": "build",
    "export_head": "formats.export",
    "load_generic_head": "assets.generic",
    "load_head": "formats.head_folder",
    "load_performance": "formats.timeline_file",
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
