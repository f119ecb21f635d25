"""A face and its head over time: timelines, and heads that perform them.

`load_timeline` reads one from a file, `animate_head` lets a head perform it into a video, pictures
or a model; a `Timeline` can also be made of `Clip`s and `Curve`s.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
