"""Photos to cameras, shape and texture: a head, and how it came about.

`build_head` gives the head, `build_head_folder` also writes it with a report; `fit_views` is the
part of it that finds cameras and shape ([Pighin 2002] sec. 3 and 4).
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
