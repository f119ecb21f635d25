"""mien: photographs to a textured head that performs.

The names below are loaded when they are first used, so that `import mien` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mien.animate.timeline import Timeline
    from mien.assets.generic import load_generic_head
    from mien.camera import Camera
    from mien.capture.faces.detector import LandmarkDetector
    from mien.errors import EstimationError, FileFormatError, InputError, MienError
    from mien.head import Head
    from mien.io.examples.example_folder import load_examples, write_examples
    from mien.io.head.head_folder import load_head, save_head
    from mien.io.mesh.export import export_head
    from mien.io.timeline.timeline_file import load_performance
    from mien.io.tracks.track_csv import load_track, write_track
    from mien.mesh import Mesh
    from mien.pipelines.animate import Take, animate_head
    from mien.pipelines.build import Build, BuildOptions, build_head
    from mien.pipelines.examples import gather_examples
    from mien.pipelines.synthesize import synthesize_expression
    from mien.pipelines.track import Tracked, track_video
    from mien.pipelines.tracking.outputs import TrackFiles
    from mien.reconstruction.fit import FitOptions
    from mien.render.picture import HeadRenderer, render_head
    from mien.rig.rig import Rig
    from mien.rig.state import FaceState, Gaze
    from mien.synthesis.examples.example_set import Example, ExampleSet
    from mien.synthesis.heads.synthesizer import HeadSynthesis, HeadSynthesizer
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
    "Build": "pipelines.build",
    "BuildOptions": "pipelines.build",
    "Camera": "camera",
    "EstimationError": "errors",
    "Example": "synthesis.examples.example_set",
    "ExampleSet": "synthesis.examples.example_set",
    "FaceState": "rig.state",
    "FileFormatError": "errors",
    "FitOptions": "reconstruction.fit",
    "Gaze": "rig.state",
    "Head": "head",
    "HeadRenderer": "render.picture",
    "HeadSynthesis": "synthesis.heads.synthesizer",
    "HeadSynthesizer": "synthesis.heads.synthesizer",
    "InputError": "errors",
    "LandmarkDetector": "capture.faces.detector",
    "Mesh": "mesh",
    "MienError": "errors",
    "Rig": "rig.rig",
    "Synthesis": "synthesis.synthesizer",
    "SynthesisOptions": "synthesis.synthesizer",
    "Synthesizer": "synthesis.synthesizer",
    "Take": "pipelines.animate",
    "Timeline": "animate.timeline",
    "Track": "track.state",
    "TrackFiles": "pipelines.tracking.outputs",
    "TrackOptions": "track.tracker",
    "TrackState": "track.state",
    "Tracked": "pipelines.track",
    "TrackedFrame": "track.state",
    "Tracker": "track.tracker",
    "animate_head": "pipelines.animate",
    "build_head": "pipelines.build",
    "export_head": "io.mesh.export",
    "gather_examples": "pipelines.examples",
    "load_examples": "io.examples.example_folder",
    "load_generic_head": "assets.generic",
    "load_head": "io.head.head_folder",
    "load_performance": "io.timeline.timeline_file",
    "load_track": "io.tracks.track_csv",
    "render_head": "render.picture",
    "save_head": "io.head.head_folder",
    "synthesize_expression": "pipelines.synthesize",
    "track_video": "pipelines.track",
    "write_examples": "io.examples.example_folder",
    "write_track": "io.tracks.track_csv",
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
