"""What a face can do: photographed expressions, face units and gaze.

A `FaceState` says what the face does, a `Rig` poses the face of one head so; `default_masks` are
the regions that can be moved by themselves.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
