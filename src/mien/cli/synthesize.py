"""`mien synthesize`: which options there are, and what they call."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from mien.cli.printing import Json, print_result
from mien.cli.progress import terminal_progress

if TYPE_CHECKING:
    from mien.pipelines.synthesize_head import HeadView
    from mien.synthesis.synthesizer import SynthesisOptions


def synthesize(
    examples: Annotated[
        Path,
        typer.Argument(help="What `mien examples` made, or a head folder that `mien build` made."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.png or .jpg.")],
    points: Annotated[
        Path | None,
        typer.Option(
            help="P.json, .tem or .pts: three or more feature points, px of the neutral example. "
            "Of a head, P.json: one or more, [x, y, z] in mm of its own space."
        ),
    ] = None,
    photo: Annotated[
        Path | None,
        typer.Option(help="A photo whose face has the expression, in whose place it is drawn."),
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option(help="W.json: which examples made which subregion, in which share."),
    ] = None,
    save_points: Annotated[
        Path | None,
        typer.Option(help="Of examples: .json, .tem or .pts: all feature points of the picture."),
    ] = None,
    head: Annotated[
        Literal["auto", "still", "moved"],
        typer.Option(
            help="Of --points: has the head moved since the neutral example? The likelier, or so."
        ),
    ] = "auto",
    face: Annotated[
        int | None,
        typer.Option(
            min=1, help="Of --photo: which face, left to right from 1; the largest by default."
        ),
    ] = None,
    paper: Annotated[
        bool,
        typer.Option(
            "--paper", help="As [Zhang 2006] prints it; the options below still count when given."
        ),
    ] = False,
    propagation: Annotated[
        Literal["closed-form", "printed"] | None,
        typer.Option(help="All points from some: closed-form, or printed, [Zhang 2006]'s."),
    ] = None,
    distance_penalty: Annotated[
        float | None,
        typer.Option(help="Prefer examples that are near: 0.05 by default, [Zhang 2006] has 0."),
    ] = None,
    slack: Annotated[
        float | None,
        typer.Option(help="How far shares may fall below 0; 0 by default and in [Zhang 2006]."),
    ] = None,
    upper_face_as_one: Annotated[
        bool,
        typer.Option(
            "--upper-face-as-one",
            help="Brows, lids, eyes and forehead of the same examples: fewer double brows.",
        ),
    ] = False,
    yaw: Annotated[
        float | None, typer.Option(help="Of a head: degrees; it turns to its own left.")
    ] = None,
    pitch: Annotated[float | None, typer.Option(help="Of a head: degrees; it tips down.")] = None,
    size: Annotated[
        str | None, typer.Option(help="Of a head: WIDTHxHEIGHT in px, 800x1000 by default.")
    ] = None,
    background: Annotated[
        str | None,
        typer.Option(
            metavar="COLOUR", help="Of a head: as #204060; transparent by default in a .png."
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """The picture of an expression, from a few feature points or the face of a photo."""
    from mien.io.head.head_folder import is_head_folder
    from mien.pipelines.synthesize import synthesize_expression

    options = _options(paper, propagation, distance_penalty, slack, upper_face_as_one)
    view = {"--yaw": yaw, "--pitch": pitch, "--size": size, "--background": background}
    if is_head_folder(examples):
        unused = {"--head": None if head == "auto" else head, "--face": face}
        _refuse(unused | {"--save-points": save_points}, "a set of examples")
        _synthesize_head(examples, output, points, photo, weights, options, not paper, view, json_)
        return
    _refuse(view, "a head folder")
    if photo is None:
        _refuse({"--face": face}, "--photo")
    elif points is None:
        _refuse({"--head": None if head == "auto" else head}, "--points")
    with terminal_progress(json_) as progress:
        result = synthesize_expression(
            examples,
            output,
            points=points,
            photo=photo,
            weights=weights,
            save_points=save_points,
            options=options,
            head=head,
            face=face,
            progress=progress,
        )
    height, width = result.synthesis.image.shape[:2]
    _print(json_, output, weights, (width, height), {"hull_px": result.hull_px}, result.notes)


def _synthesize_head(
    folder: Path,
    output: Path,
    points: Path | None,
    photo: Path | None,
    weights: Path | None,
    options: SynthesisOptions,
    warp: bool,
    view: dict[str, Any],
    json_: bool,
) -> None:
    """Synthesize and print an expression of a head."""
    from mien.pipelines.synthesize_head import synthesize_head

    if photo is not None:
        _refuse(view, "--points; a photo has its own")
    with terminal_progress(json_) as progress:
        result = synthesize_head(
            folder,
            output,
            points=points,
            photo=photo,
            weights=weights,
            options=options,
            warp=warp,
            view=_view(**{name.removeprefix("--"): value for name, value in view.items()}),
            progress=progress,
        )
    _print(json_, output, weights, result.size, {"hull_mm": result.hull_mm}, result.notes)


def _print(
    json_: bool,
    output: Path,
    weights: Path | None,
    size: tuple[int, int],
    hull: dict[str, dict[str, float]],
    notes: tuple[str, ...],
) -> None:
    width, height = size
    data = {
        "output": str(output),
        "width": width,
        "height": height,
        "weights": None if weights is None else str(weights),
        **{key: {name: round(off, 3) for name, off in by.items()} for key, by in hull.items()},
        "notes": list(notes),
    }
    print_result(json_, data, f"{output}: {width}x{height}", notes)


def _view(
    yaw: float | None, pitch: float | None, size: str | None, background: str | None
) -> HeadView:
    from math import radians

    from mien.cli.options import check_finite, parse_colour, parse_size
    from mien.pipelines.synthesize_head import HeadView

    return HeadView(
        yaw=radians(check_finite("--yaw", yaw or 0.0)),
        pitch=radians(check_finite("--pitch", pitch or 0.0)),
        size=parse_size("--size", size or "800x1000"),
        background=None if background is None else parse_colour("--background", background),
    )


def _refuse(options: dict[str, Any], where: str) -> None:
    """Refuse options that are given and apply elsewhere only.

    Raises:
        InputError: names the first.
    """
    from mien.errors import InputError

    for name, value in options.items():
        if value is not None:
            raise InputError(name, f"this only with {where}", value)


def _options(
    paper: bool,
    propagation: str | None,
    distance_penalty: float | None,
    slack: float | None,
    upper_face_as_one: bool,
) -> SynthesisOptions:
    """The paper's options or the defaults, overridden by those that are given."""
    from dataclasses import replace

    from mien.synthesis.inference.coefficients import UPPER_FACE
    from mien.synthesis.synthesizer import SynthesisOptions

    given: dict[str, Any] = {
        "propagation": propagation,
        "distance_penalty": distance_penalty,
        "slack": slack,
        "tied": (UPPER_FACE,) if upper_face_as_one else None,
    }
    defaults = SynthesisOptions.paper() if paper else SynthesisOptions()
    return replace(defaults, **{name: value for name, value in given.items() if value is not None})
