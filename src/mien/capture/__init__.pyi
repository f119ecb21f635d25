"""The public names of `mien.capture`: this is their only list; `mien.lazy` reads it."""

from mien.capture.annotations import Annotations as Annotations
from mien.capture.annotations import load_annotations as load_annotations
from mien.capture.annotations import save_annotations as save_annotations
from mien.capture.faces.detector import LandmarkDetector as LandmarkDetector
from mien.capture.faces.landmarks import Landmarks as Landmarks
from mien.capture.images.photos import Photo as Photo
from mien.capture.images.photos import load_photo as load_photo
from mien.capture.source import Capture as Capture
from mien.capture.source import CapturedView as CapturedView
from mien.capture.source import load_capture as load_capture
from mien.capture.video.video import Video as Video
from mien.pipelines.demo import demo_photos as demo_photos
