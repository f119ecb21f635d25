"""The public names of `mien.render`: this is their only list; `mien.lazy` reads it."""

from mien.render.orbit import orbit_camera as orbit_camera
from mien.render.orbit import turntable_cameras as turntable_cameras
from mien.render.picture import HeadRenderer as HeadRenderer
from mien.render.picture import render_head as render_head
from mien.render.picture import turntable_frames as turntable_frames
