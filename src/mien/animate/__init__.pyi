"""The public names of `mien.animate`: this is their only list; `mien.lazy` reads it."""

from mien.animate.curves import Curve as Curve
from mien.animate.curves import constant as constant
from mien.animate.from_track import rest_camera as rest_camera
from mien.animate.from_track import track_timeline as track_timeline
from mien.animate.layers import Blink as Blink
from mien.animate.layers import Breathing as Breathing
from mien.animate.perform import frame_times as frame_times
from mien.animate.perform import moved_camera as moved_camera
from mien.animate.perform import sample_timeline as sample_timeline
from mien.animate.timeline import Clip as Clip
from mien.animate.timeline import Layer as Layer
from mien.animate.timeline import Moment as Moment
from mien.animate.timeline import Placement as Placement
from mien.animate.timeline import Timeline as Timeline
from mien.io.mesh.animation_baking import bake_animation as bake_animation
from mien.io.mesh.head_animation import HeadAnimation as HeadAnimation
from mien.io.timeline.timeline_file import load_timeline as load_timeline
from mien.io.timeline.timeline_json import save_timeline as save_timeline
from mien.pipelines.animate import AnimationResult as AnimationResult
from mien.pipelines.animate import animate_head as animate_head
