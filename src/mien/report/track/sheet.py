"""A contact sheet: frames of a video above, what was found in them below.

Source:
    [Pighin 2002] figs. 10 and 17.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mien.arrays import Array, UInt8
from mien.head import Head
from mien.render.picture import GREY, HeadRenderer
from mien.render.shade import over_background
from mien.report.sheet import arrange_grid
from mien.report.track.caption import say_lost, write_on
from mien.report.track.comparison import draw_tracked
from mien.report.track.window import window_of
from mien.track.state import Track, TrackedFrame

_CELL = (232, 320)
"""Width and height that a frame's picture may have, px."""
_WHITE = (255, 255, 255)


def evenly_chosen(track: Track, count: int) -> Track:
    """The track with so many of its frames alone, from the first to the last."""
    last = len(track.frames) - 1
    chosen = np.unique(np.rint(np.linspace(0, last, min(count, last + 1))).astype(int))
    return replace(track, frames=tuple(track.frames[index] for index in chosen))


def contact_sheet(
    frames: Iterable[tuple[UInt8[Array, "h w 3"], TrackedFrame]],
    track: Track,
    head: Head | HeadRenderer,
    *,
    columns: int = 8,
) -> UInt8[Array, "h w 3"]:
    """Every frame above the drawn head, row after row; cut to where the head goes.

    Args:
        frames: as for overlay_frames; one at least.
        track: that they are of.
    """
    renderer = head if isinstance(head, HeadRenderer) else HeadRenderer(head)
    window = window_of(track, renderer.head, _CELL)
    cells = []
    for pixels, found in frames:
        camera = None if found.state is None else window.camera(track, found.state)
        drawn = draw_tracked(renderer, track, found, camera)
        frame = window.cut(pixels, track)
        if drawn is None:
            below = say_lost(np.full_like(frame, GREY))
        else:
            below = over_background(drawn.picture, GREY)[..., :3]
        above = write_on(frame, str(found.frame), _WHITE, at=(0.12, 0.06), size=15, outline=2)
        cells.append(np.concatenate([above, below]))
    return arrange_grid(cells, columns)
