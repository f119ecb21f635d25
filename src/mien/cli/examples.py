"""`mien examples`: which options there are, and what they call."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mien.cli.printing import Json, print_result
from mien.cli.progress import terminal_progress

_PICTURE = "FRAME|FILE"
_PICTURES = "FRAME|FROM-TO|FILE"


def examples(
    source: Annotated[
        Path, typer.Argument(help="A folder of photos, or a video, of one person's expressions.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The folder of examples that is written.")
    ],
    count: Annotated[int, typer.Option(min=1, max=1000, help="How many examples at most.")] = 60,
    neutral: Annotated[
        str | None,
        typer.Option(metavar=_PICTURE, help="The face at rest; found by default."),
    ] = None,
    standard: Annotated[
        str | None,
        typer.Option(
            metavar=_PICTURE,
            help="The picture, mouth open, that subregions are drawn in; found by default.",
        ),
    ] = None,
    include: Annotated[
        list[str] | None,
        typer.Option(metavar=_PICTURES, help="An example in any case; may be repeated."),
    ] = None,
    exclude: Annotated[
        list[str] | None,
        typer.Option(metavar=_PICTURES, help="Not to be used; may be repeated."),
    ] = None,
    face: Annotated[
        int | None,
        typer.Option(
            min=1, help="Which face of photos, from left to right from 1; the largest by default."
        ),
    ] = None,
    max_side: Annotated[
        int, typer.Option(min=128, max=4096, help="px; larger photos are reduced to it.")
    ] = 1200,
    even: Annotated[
        bool, typer.Option(help="Bring all photos to the exposure of the face at rest.")
    ] = True,
    json_: Json = False,
) -> None:
    """Photos or a video to a set of examples that expressions are mixed from."""
    from mien.pipelines.examples import COUNTED, ExampleRequest, save_example_folder

    request = ExampleRequest(
        count=count,
        neutral=neutral,
        standard=standard,
        include=tuple(include or ()),
        exclude=tuple(exclude or ()),
        face=face,
        max_side=max_side,
        even=even,
    )
    with terminal_progress(json_, counted=COUNTED) as progress:
        gathered = save_example_folder(source, output, request=request, progress=progress)
    example_set = gathered.examples
    names = [example.name for example in example_set.examples]
    data = {
        "examples": str(output),
        "sheet": str(output / "examples.jpg"),
        "neutral": names[0],
        "standard": names[example_set.standard],
        "teeth": [names[index] for index in example_set.teeth],
        "chosen": gathered.why,
        "statistics": len(example_set.statistics),
        "notes": list(gathered.notes),
    }
    count = len(example_set.statistics)
    text = (
        f"{output}: {len(names)} examples, point statistics of {count} pictures\n"
        f"  at rest: {names[0]}; mouth open: {names[example_set.standard]}\n"
        f"  look at {output / 'examples.jpg'}"
    )
    print_result(json_, data, text, gathered.notes)
