"""Limits of what is read and made; anything beyond is refused before any work.

docs/reference/limits.md explains them. Every limit is defined here only.
"""

from __future__ import annotations

MIB = 1 << 20

MAX_SECONDS = 86_400.0
"""Of a timeline, a clip within one, a track, a recording: a day."""
MAX_FPS = 1000.0
"""Frames a second of a timeline, a track, a recording, of what is made of them."""
MIN_FPS = 0.01
"""Frames a second of what is made of a performance, at least."""
MAX_FRAMES = 1_000_000
"""Of a performance, a track, a recording: four and a half hours at 60 frames a second."""
MAX_GAP_SECONDS = 3600.0
"""Between two frames of a Live Link recording."""
MAX_SIDE = 8192
"""px, of a picture that is drawn, of a texture."""
MAX_PHOTO_SIDE = 65_535
"""px, of a photo or a video of a camera: a JPEG's own limit."""
MAX_MM = 10_000.0
"""Of a vertex' coordinate and of a face unit's offset, from 0 either way."""

MAX_NAME_BYTES = 200
"""Of an expression's name in UTF-8: files are named after it, and such names end at 255."""

UNIT_RANGE = (-0.5, 1.5)
"""Weight of a face unit, the lowest and the highest: as those of photographed expressions."""

LARGEST = 1e9
"""Of numbers in a document: sums and products of such stay exact enough."""
MAX_DIGITS = 1000
"""Of a whole number in a JSON document."""
MAX_DEPTH = 64
"""Lists and objects within each other in a JSON document."""
MAX_CONTAINERS = 4_000_000
"""Lists and objects in a JSON document altogether."""
MAX_JSON_BYTES = 64 * MIB
"""Of a JSON document."""
MAX_TABLE_BYTES = 256 * MIB
"""Of a track's or a recording's .csv, and of a journal."""
MAX_LINE = MIB
"""Characters of a line in one of these."""
MAX_POINTS_BYTES = 4 * MIB
"""Of a .tem or .pts."""

MAX_ARRAY_BYTES = 512 * MIB
"""Of one array in an .npz, unpacked."""
MAX_ARRAYS_BYTES = 1024 * MIB
"""Of all arrays that are read from one .npz, unpacked."""
MAX_ARRAYS = 10_000
"""Arrays that an .npz holds, read or not."""
