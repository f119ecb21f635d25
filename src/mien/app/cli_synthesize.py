"""`mien synthesize`: which options there are, and what they call."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from mien.app.printing import Json, print_result
from mien.app.progress import terminal_progress

if TYPE_CHECKING:
    from mien.synthesis.synthesizer import SynthesisOptions


def synthesize(
    examples: Annotated[
        Path, typer.Argument(help="A folder of examples that `mien examples` made.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="OUT.png or .jpg.")],
    points: Annotated[
        Path | None,
        typer.Option(
            help="P.json, .tem or .pts: three or more feature points, px of the neutral example."
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
        typer.Option("--paper", help="As Z06 prints it; the options below still count when given."),
    ] = False,
    propagation: Annotated[
        Literal["closed-form", "printed"] | None,
        typer.Option(help="All points from some: closed-form by default, printed is Z06's."),
    ] = None,
    distance_penalty: Annotated[
        float | None,
        typer.Option(help="Prefer examples that are near: 0.02 by default, Z06 has 0."),
    ] = None,
    slack: Annotated[
        float | None,
        typer.Option(help="How far shares may fall below 0; 0 by default and in Z06."),
    ] = None,
    json_: Json = False,
) -> None:
    """The picture of an expression, from a few feature points or the face of a photo."""
    from mien.app.synthesize import synthesize_expression

    options = _options(paper, propagation, distance_penalty, slack)
    with terminal_progress(json_) as progress:
        made = synthesize_expression(
            examples,
            output,
            points=points,
            photo=photo,
            weights=weights,
            options=options,
            head=head,
            face=face,
            progress=progress,
        )
    height, width = made.synthesis.image.shape[:2]
    data = {
        "output": str(output),
        "width": width,
        "height": height,
        "weights": None if weights is None else str(weights),
        "hull_px": {name: round(px, 3) for name, px in made.hull_px.items()},
        "notes": list(made.notes),
    }
    print_result(json_, data, f"{output}: {width}x{height}", made.notes)


def _options(
    paper: bool, propagation: str | None, distance_penalty: float | None, slack: float | None
) -> SynthesisOptions:
    """The paper's or the usual ones, and what was said otherwise."""
    from dataclasses import replace

    from mien.synthesis.synthesizer import SynthesisOptions

    given: dict[str, Any] = {
        "propagation": propagation,
        "distance_penalty": distance_penalty,
        "slack": slack,
    }
    usual = SynthesisOptions.paper() if paper else SynthesisOptions()
    return replace(usual, **{name: value for name, value in given.items() if value is not None})
