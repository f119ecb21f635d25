"""`mien track`: which options go together, and what they call."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from mien.cli.options import check_seconds
from mien.cli.printing import Json, print_result
from mien.cli.progress import terminal_progress
from mien.errors import InputError


def track(
    video: Annotated[
        str, typer.Argument(help="A video; or a camera of this computer, of which 0 is the first.")
    ],
    head: Annotated[Path, typer.Option(help="A head folder that `mien build` made.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="TRACK.csv; a camera may do without."),
    ] = None,
    overlay: Annotated[
        Path | None,
        typer.Option(help="X.mp4 or .webm: the frame, the drawn face over it, and alone."),
    ] = None,
    plots: Annotated[Path | None, typer.Option(help="A folder for plots of all numbers.")] = None,
    live_link: Annotated[
        Path | None, typer.Option(help="X.csv as Live Link Face records it.")
    ] = None,
    openface: Annotated[Path | None, typer.Option(help="X.csv as OpenFace writes it.")] = None,
    lens: Annotated[
        str | None,
        typer.Option(
            metavar="FOCAL",
            help="1200px, 28mm (of 35 mm film) or 60deg; estimated by default.",
        ),
    ] = None,
    smooth: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Smooth over such a time, without lag; live, with just that lag. Off by default.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where an earlier run was stopped.")
    ] = False,
    stream: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS",
            help="livelink://HOST:PORT or vmc://HOST:PORT, live; may be repeated.",
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="A video in real time, in place of a camera.")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(help="Stop after so many; live, Ctrl-C stops, too.")
    ] = None,
    json_: Json = False,
) -> None:
    """The performance in a video, or before a camera: head and face in every frame."""
    is_live = live or bool(stream) or (video.isascii() and video.isdecimal())
    _check_together(
        video,
        output,
        is_live,
        beside_a_table={"--live-link": live_link, "--openface": openface},
        not_live={"--overlay": overlay, "--plots": plots, "--resume": resume},
        only_live={"--seconds": seconds},
    )
    check_seconds("--smooth", smooth)
    check_seconds("--seconds", seconds)

    from mien.io.head.head_folder import load_head
    from mien.pipelines.tracking.outputs import TrackFiles

    files = None if output is None else TrackFiles(output, overlay, plots, live_link, openface)
    if files is not None:
        files.check(Path(video), read=[head])
    if is_live:
        from mien.cli.live_line import live_line, summary_text
        from mien.pipelines.live import track_live_video

        with live_line(json_) as on_status:
            summary = track_live_video(
                video,
                load_head(head),
                files,
                stream or [],
                lens=lens,
                lag=smooth,
                seconds=seconds,
                on_status=on_status,
            )
        _print(json_, output, asdict(summary), summary_text(summary), summary.notes)
    elif files is not None:
        from mien.pipelines.track import FRAME_STAGES, track_video

        with (
            _note_on_resume(files.table),
            terminal_progress(json_, counted=FRAME_STAGES) as progress,
        ):
            tracked = track_video(
                video,
                load_head(head),
                files,
                lens=lens,
                smooth_seconds=smooth,
                resume=resume,
                progress=progress,
            )
        _print(json_, output, asdict(tracked), str(tracked), tracked.notes)


@contextmanager
def _note_on_resume(table: Path) -> Iterator[None]:
    """Print how to resume if the block is stopped while there is a journal."""
    from mien.io.tracks.track_journal import journal_of

    try:
        yield
    except KeyboardInterrupt:
        if journal_of(table).exists():
            print("note: stopped; with --resume it goes on from here", file=sys.stderr)
        raise


def _check_together(
    video: str,
    output: Path | None,
    is_live: bool,
    *,
    beside_a_table: Mapping[str, object],
    not_live: Mapping[str, object],
    only_live: Mapping[str, object],
) -> None:
    """Refuse options that exclude each other.

    Args:
        video: as given.
        output: as given.
        is_live: whether the video is tracked live.
        beside_a_table: options by name, falsy where they were not given.
        not_live: options by name, falsy where they were not given.
        only_live: options by name, falsy where they were not given.

    Raises:
        InputError: names the first of them.
    """
    for name in _given(not_live) if is_live else ():
        raise InputError(name, "a video that is not tracked live", video)
    for name in () if is_live else _given(only_live):
        raise InputError(name, "a camera, or a video with --live", video)
    for name in () if output else _given(beside_a_table):
        raise InputError(name, "-o TRACK.csv beside it", "nothing")
    if not (output or is_live):
        raise InputError("-o", "where the track goes, as -o track.csv", "nothing")


def _given(options: Mapping[str, object]) -> list[str]:
    return [name for name, value in options.items() if value not in (None, False)]


def _print(
    as_json: bool, output: Path | None, data: dict[str, Any], text: str, notes: tuple[str, ...]
) -> None:
    named = {"output": None if output is None else str(output)}
    print_result(as_json, named | data, text if output is None else f"{output}: {text}", notes)
