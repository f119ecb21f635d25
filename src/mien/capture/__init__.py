"""Photos and videos, and the faces in them.

`load_capture` reads a folder of photos, a photo or a video and finds the landmarks of the face in
each picture; `demo_photos` is a folder of photos that comes with mien.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
