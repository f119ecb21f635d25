"""The public names of `mien.io`: this is their only list; `mien.lazy` reads it."""

from mien.io.examples.example_folder import load_examples as load_examples
from mien.io.examples.example_folder import save_examples as save_examples
from mien.io.files.frames import save_frames as save_frames
from mien.io.files.image import load_image as load_image
from mien.io.files.image import save_image as save_image
from mien.io.files.video import save_video as save_video
from mien.io.head.head_folder import load_head as load_head
from mien.io.head.head_folder import save_head as save_head
from mien.io.landmarks.points_file import load_feature_points as load_feature_points
from mien.io.landmarks.points_file import save_feature_points as save_feature_points
from mien.io.live.live_link_csv import load_live_link as load_live_link
from mien.io.live.live_link_csv import save_live_link as save_live_link
from mien.io.mesh.export import export_head as export_head
from mien.io.timeline.timeline_file import load_timeline as load_timeline
from mien.io.timeline.timeline_json import save_timeline as save_timeline
from mien.io.tracks.openface_csv import save_openface as save_openface
from mien.io.tracks.track_csv import load_track as load_track
from mien.io.tracks.track_csv import save_track as save_track
