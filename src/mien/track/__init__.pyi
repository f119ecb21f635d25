"""The public names of `mien.track`: this is their only list; `mien.lazy` reads it."""

from mien.animate.from_track import track_timeline as track_timeline
from mien.io.tracks.track_csv import load_track as load_track
from mien.io.tracks.track_csv import save_track as save_track
from mien.pipelines.track import Tracked as Tracked
from mien.pipelines.track import track_video as track_video
from mien.pipelines.tracking.outputs import TrackFiles as TrackFiles
from mien.track.landmarks.initialization import HeadDetector as HeadDetector
from mien.track.photometric.frame_fit import FrameFitOptions as FrameFitOptions
from mien.track.series import Series as Series
from mien.track.series import series_of as series_of
from mien.track.smoothing import smooth_track as smooth_track
from mien.track.state import Layout as Layout
from mien.track.state import Track as Track
from mien.track.state import TrackedFrame as TrackedFrame
from mien.track.state import TrackState as TrackState
from mien.track.tracker import Tracker as Tracker
from mien.track.tracker import TrackOptions as TrackOptions
