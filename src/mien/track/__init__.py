"""A head in a video, frame by frame ([Pighin 2002] sec. 6).

`track_video` follows a head through a video and writes a table, which `load_track` reads; the
numbers of a `Track` as arrays, to plot or to compute with, are `series_of(track)`. A `Tracker`
takes frames one by one, from wherever they come.
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
