"""The files that `mien track` writes: the table, an overlay, plots, tables for other programs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mien.animate.from_track import track_moments
from mien.capture.video.video import Video
from mien.errors import InputError
from mien.head import Head
from mien.io.files.atomic import check_file_place, check_files_apart
from mien.io.files.video import check_video_place
from mien.io.live.live_link_csv import save_live_link
from mien.io.tracks.openface_csv import save_openface
from mien.io.tracks.track_csv import check_track_place, save_track
from mien.io.tracks.track_journal import journal_of
from mien.io.tracks.track_json import sidecar_of
from mien.progress import Progress
from mien.reading.names import portable_name
from mien.rig.unit_decomposition import units_from_state
from mien.track.state import Track

if TYPE_CHECKING:
    from mien.render.picture import HeadRenderer

DRAWING_OVERLAY, DRAWING_PLOTS = "Drawing the overlay", "Drawing plots"


@dataclass(frozen=True)
class TrackFiles:
    """Which files a track is written to; None: not written.

    Attributes:
        table: TRACK.csv, with TRACK.json beside it.
        overlay: .mp4 or .webm.
        plots: a folder.
        live_link: a Live Link Face recording.
        openface: a table like OpenFace's.
    """

    table: Path
    overlay: Path | None = None
    plots: Path | None = None
    live_link: Path | None = None
    openface: Path | None = None

    def check(self, video: Path, *, read: Iterable[str | Path] = ()) -> None:
        """Refuse, before any work is done, places that cannot be written.

        Args:
            video: that is tracked.
            read: files and folders beside the video that must stay as they are, as the head's.

        Raises:
            InputError: names the first of them; two results in one file, or a result in an input.
        """
        self._check_distinct(video)
        written = [self.table, self.overlay, self.live_link, self.openface]
        beside = [sidecar_of(self.table), journal_of(self.table)]
        check_files_apart([*filter(None, written), *beside], [video, *read])
        check_track_place(self.table)
        check_file_place(self.table)
        if self.overlay:
            check_video_place(self.overlay)
        if self.plots:
            from mien.report.track.plots import check_plots_place

            check_plots_place(self.plots)
        for path in filter(None, (self.live_link, self.openface)):
            check_file_place(path)

    def write(self, track: Track, video: Video, head: Head, progress: Progress) -> Iterator[str]:
        """Write all of them, the table first.

        Args:
            track: of the video.
            video: that was tracked.
            head: that was tracked.
            progress: called with the stage, steps done and their total.

        Yields:
            Notes for the user.
        """
        save_track(self.table, track)
        units_of = partial(units_from_state, head)
        if self.openface:
            save_openface(self.openface, track, units_of=units_of)
        if self.live_link and any(frame.state for frame in track.frames):
            save_live_link(self.live_link, track_moments(track), units_of=units_of)
        elif self.live_link:
            yield f"{self.live_link}: not written: no frame shows the face"
        if self.overlay or self.plots:
            from mien.render.picture import HeadRenderer

            self._draw(track, video, HeadRenderer(head), progress)

    def _draw(self, track: Track, video: Video, renderer: HeadRenderer, progress: Progress) -> None:
        if self.overlay:
            from mien.report.track.overlay import save_overlay

            save_overlay(
                self.overlay, video, track, renderer, progress=partial(progress, DRAWING_OVERLAY)
            )
        if self.plots:
            from mien.report.track.plots import save_track_plots

            save_track_plots(
                self.plots,
                track,
                title=portable_name(video.path),
                video=video,
                head=renderer,
                progress=partial(progress, DRAWING_PLOTS),
            )

    def _check_distinct(self, video: Path) -> None:
        names = {video.resolve(): "video"}
        for name, path in ((field.name, getattr(self, field.name)) for field in fields(self)):
            if path is not None:
                other = names.setdefault(path.resolve(), name)
                if other != name:
                    raise InputError(path, f"another name than that of the {other}", "the same")
