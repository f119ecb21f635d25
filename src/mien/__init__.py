"""mien: photographs to a textured head that performs.

The names below are loaded when they are first used, so that `import mien` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mien.animate.timeline import Timeline
    from mien.app.animate import Take, animate_head
    from mien.app.examples import gather_examples
    from mien.app.synthesize import synthesize_expression
    from mien.app.track import Tracked, track_video
    from mien.app.track_files import TrackFiles
    from mien.assets.generic import load_generic_head
    from mien.build import Build, BuildOptions, build_head
    from mien.camera import Camera
    from mien.capture.detector import LandmarkDetector
    from mien.errors import EstimationError, FileFormatError, InputError, MienError
    from mien.expressions.rig import Rig
    from mien.expressions.state import FaceState, Gaze
    from mien.formats.example_folder import load_examples, write_examples
    from mien.formats.export import export_head
    from mien.formats.head_folder import load_head, save_head
    from mien.formats.timeline_file import load_performance
    from mien.formats.track_csv import load_track, write_track
    from mien.mesh import Mesh
    from mien.model.fit import FitOptions
    from mien.model.head import Head
    from mien.render.picture import HeadRenderer, render_head
    from mien.synthesis.examples import Example, ExampleSet
    from mien.synthesis.head_synthesizer import HeadSynthesis, HeadSynthesizer
    from mien.synthesis.synthesizer import Synthesis, SynthesisOptions, Synthesizer
    from mien.track.state import Track, TrackedFrame, TrackState
    from mien.track.tracker import Tracker, TrackOptions

__version__: str

__all__ = [
    "Build",
    "BuildOptions",
    "Camera",
    "EstimationError",
    "Example",
    "ExampleSet",
    "FaceState",
    "FileFormatError",
    "FitOptions",
    "Gaze",
    "Head",
    "HeadRenderer",
    "HeadSynthesis",
    "HeadSynthesizer",
    "InputError",
    "LandmarkDetector",
    "Mesh",
    "MienError",
    "Rig",
    "Synthesis",
    "SynthesisOptions",
    "Synthesizer",
    "Take",
    "Timeline",
    "Track",
    "TrackFiles",
    "TrackOptions",
    "TrackState",
    "Tracked",
    "TrackedFrame",
    "Tracker",
    "animate_head",
    "build_head",
    "export_head",
    "gather_examples",
    "load_examples",
    "load_generic_head",
    "load_head",
    "load_performance",
    "load_track",
    "render_head",
    "save_head",
    "synthesize_expression",
    "track_video",
    "write_examples",
    "write_track",
]

_HOMES = {
    "Build": "build",
    "BuildOptions": "build",
    "Camera": "camera",
    "EstimationError": "errors",
    "Example": "synthesis.examples",
    "ExampleSet": "synthesis.examples",
    "FaceState": "expressions.state",
    "FileFormatError": "errors",
    "FitOptions": "model.fit",
    "Gaze": "expressions.state",
    "Head": "model.head",
    "HeadRenderer": "render.picture",
    "HeadSynthesis": "synthesis.head_synthesizer",
    "HeadSynthesizer": "synthesis.head_synthesizer",
    "InputError": "errors",
    "LandmarkDetector": "capture.detector",
    "Mesh": "mesh",
    "MienError": "errors",
    "Rig": "expressions.rig",
    "Synthesis": "synthesis.synthesizer",
    "SynthesisOptions": "synthesis.synthesizer",
    "Synthesizer": "synthesis.synthesizer",
    "Take": "app.animate",
    "Timeline": "animate.timeline",
    "Track": "track.state",
    "TrackFiles": "app.track_files",
    "TrackOptions": "track.tracker",
    "TrackState": "track.state",
    "Tracked": "app.track",
    "TrackedFrame": "track.state",
    "Tracker": "track.tracker",
    "animate_head": "app.animate",
    "build_head": "build",
    "export_head": "formats.export",
    "gather_examples": "app.examples",
    "load_examples": "formats.example_folder",
    "load_generic_head": "assets.generic",
    "load_head": "formats.head_folder",
    "load_performance": "formats.timeline_file",
    "load_track": "formats.track_csv",
    "render_head": "render.picture",
    "save_head": "formats.head_folder",
    "synthesize_expression": "app.synthesize",
    "track_video": "app.track",
    "write_examples": "formats.example_folder",
    "write_track": "formats.track_csv",
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
