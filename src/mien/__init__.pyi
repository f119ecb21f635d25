"""The public names of `mien`: this is their only list; `mien.lazy` reads it."""

from mien import animate as animate
from mien import capture as capture
from mien import io as io
from mien import reconstruction as reconstruction
from mien import render as render
from mien import rig as rig
from mien import synthesis as synthesis
from mien import texture as texture
from mien import track as track
from mien.animate.timeline import Timeline as Timeline
from mien.camera import Camera as Camera
from mien.errors import EstimationError as EstimationError
from mien.errors import FileFormatError as FileFormatError
from mien.errors import InputError as InputError
from mien.errors import MienError as MienError
from mien.head import Head as Head
from mien.io.examples.example_folder import load_examples as load_examples
from mien.io.head.head_folder import load_head as load_head
from mien.io.head.head_folder import save_head as save_head
from mien.io.mesh.export import export_head as export_head
from mien.io.tracks.track_csv import load_track as load_track
from mien.mesh import Mesh as Mesh
from mien.pipelines.animate import animate_head as animate_head
from mien.pipelines.build import build_head as build_head
from mien.pipelines.examples import gather_examples as gather_examples
from mien.pipelines.synthesize import synthesize_expression as synthesize_expression
from mien.pipelines.track import track_video as track_video
from mien.pipelines.tracking.outputs import TrackFiles as TrackFiles
from mien.render.picture import render_head as render_head
from mien.rig.state import FaceState as FaceState
from mien.rig.state import Gaze as Gaze
from mien.synthesis.examples.example_set import ExampleSet as ExampleSet
from mien.track.state import Track as Track

__version__: str
