"""The command line: parses arguments, calls a pipeline, prints its result."""

from __future__ import annotations

import sys
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import typer

from mien.cli.examples import examples
from mien.cli.options import (
    check_finite,
    check_given,
    parse_colour,
    parse_count,
    parse_size,
    parse_state,
)
from mien.cli.printing import Json, print_error, print_result, set_up_streams
from mien.cli.progress import terminal_progress
from mien.cli.synthesize import synthesize
from mien.cli.track import track
from mien.limits import MAX_FPS, MAX_SIDE, MIN_FPS

app = typer.Typer(
    help="Photographs of a real person to a textured head.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Curves = Literal["epipolar", "arc-length"]
Kernel = Literal["exponential", "biharmonic", "triharmonic", "thin_plate"]
FillChoice = Literal["pyramid", "grow"]

Output = Annotated[Path, typer.Option("-o", "--output", help="Where the result goes.")]
HeadFolder = Annotated[Path, typer.Argument(help="A head folder that `mien build` made.")]
Yaw = Annotated[float, typer.Option(help="Degrees; the head turns to its own left.")]
Pitch = Annotated[float, typer.Option(help="Degrees; the head tips down.")]


@app.command()
def demo(
    output: Output = Path("mien-demo"),
    json_: Json = False,
) -> None:
    """Build, render and export a head from the photos that ship with mien."""
    from mien.pipelines.demo import run_demo

    with terminal_progress(json_) as progress:
        index = run_demo(output, progress=progress)
    print_result(json_, {"index": str(index)}, f"Open {index} in a browser.")


@app.command()
def build(
    source: Annotated[
        Path,
        typer.Argument(
            help="A folder of photos (or of one folder an expression), a photo, a video."
        ),
    ],
    output: Output,
    adjust: Annotated[
        bool,
        typer.Option(help="Bundle adjustment after the five linear steps of [Pighin 2002]."),
    ] = True,
    dense: Annotated[
        bool,
        typer.Option(help="Register several photos by all the skin that they share."),
    ] = True,
    curves: Annotated[
        Curves, typer.Option(help="How drawn curves become points in the second photo and on.")
    ] = "epipolar",
    kernel: Annotated[
        Kernel, typer.Option(help="Radial basis of the deformation; the first is [Pighin 2002]'s.")
    ] = "exponential",
    fill: Annotated[
        FillChoice, typer.Option(help="How texture that no photo shows is filled.")
    ] = "pyramid",
    texture_size: Annotated[
        int, typer.Option(min=64, max=MAX_SIDE, help="Side of the texture, px.")
    ] = 2048,
    interpupillary_mm: Annotated[
        float, typer.Option(min=30, max=100, help="Measured distance between the pupils.")
    ] = 63.0,
    face: Annotated[
        int | None,
        typer.Option(min=1, help="Which face, from left to right from 1; the largest by default."),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=1, max=24, help="How many frames at rest to pick from a video.")
    ] = 7,
    expressions: Annotated[
        str | None,
        typer.Option(
            metavar="N|none",
            help="How many expressions to pick from a video or, none, whether to keep those of "
            "photos that show others; whatever differs by default.",
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """Photos to a head folder: cameras, shape, texture and a report."""
    from mien.cli.summary import summary_json, summary_text
    from mien.pipelines.build import BuildOptions, build_head_folder
    from mien.reconstruction.fit import FitOptions

    options = BuildOptions(
        fit=FitOptions(
            adjust=adjust,
            dense=dense,
            curves=curves,
            kernel=kernel,
            interpupillary_mm=interpupillary_mm,
        ),
        fill=fill,
        texture_size=texture_size,
        face=face,
        frames=frames,
        expressions=parse_count("--expressions", expressions),
    )
    with terminal_progress(json_) as progress:
        result = build_head_folder(source, output, options=options, progress=progress)
    print_result(json_, summary_json(result, output), summary_text(result, output))


@app.command()
def render(
    head: HeadFolder,
    output: Output,
    yaw: Yaw = 0.0,
    pitch: Pitch = 0.0,
    roll: Annotated[float, typer.Option(help="Degrees; the head tips to its own right.")] = 0.0,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT in px.")] = "800x1000",
    camera: Annotated[
        str | None,
        typer.Option(metavar="PHOTO", help="Reproduce the view of this photo, expression too."),
    ] = None,
    expression: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=AMOUNT", help="A photographed expression, as joy=0.6."),
    ] = None,
    region: Annotated[
        list[str] | None,
        typer.Option(
            metavar="REGION:NAME=AMOUNT",
            help="One in a region, instead of the face's there, as mouth:anger=0.4.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None, typer.Option(metavar="NAME=AMOUNT", help="A face unit, as jawOpen=0.5.")
    ] = None,
    gaze: Annotated[
        str | None,
        typer.Option(metavar="YAW,PITCH", help="Degrees; the eyes look to their own left, and up."),
    ] = None,
    background: Annotated[
        str | None, typer.Option(metavar="COLOUR", help="As #204060; transparent by default.")
    ] = None,
    json_: Json = False,
) -> None:
    """A picture of the head, with alpha."""
    from mien.io.files.atomic import check_file_place, check_files_apart
    from mien.io.files.image import image_kind, save_image
    from mien.io.head.head_folder import load_head
    from mien.render.picture import HeadRenderer, render_head

    width_height = parse_size("--size", size)
    state = parse_state(expression, region, unit, gaze)
    colour = None if background is None else parse_colour("--background", background)
    angles = [_angle("--yaw", yaw), _angle("--pitch", pitch), _angle("--roll", roll)]
    image_kind(output)
    check_files_apart([output], [head])
    check_file_place(output)
    renderer = HeadRenderer(load_head(head))
    picture = render_head(
        renderer,
        yaw=angles[0],
        pitch=angles[1],
        roll=angles[2],
        size=width_height,
        photo=camera,
        state=state,
        background=colour,
    )
    save_image(output, picture)
    notes = renderer.rig.hull_notes(state)
    print_result(json_, {"output": str(output), "notes": notes}, str(output), notes)


@app.command()
def export(
    head: HeadFolder,
    output: Output,
    expression: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which expression an .obj shows; others hold them all."),
    ] = None,
    json_: Json = False,
) -> None:
    """The head as .glb, .obj or .usdz, face units and expressions included."""
    from mien.head import NEUTRAL
    from mien.io.head.head_folder import load_head
    from mien.io.mesh.export import check_export_place, export_head

    check_export_place(output, read=[head])
    export_head(load_head(head), output, expression=expression or NEUTRAL)
    print_result(json_, {"output": str(output), "bytes": output.stat().st_size}, str(output))


@app.command()
def animate(
    timeline: Annotated[
        Path,
        typer.Argument(help="A timeline (.json), a track (.csv), or a Live Link recording (.csv)."),
    ],
    output: Annotated[
        str,
        typer.Option(
            "-o",
            "--output",
            help="X.mp4, .webm, .glb, .usdz, .csv, .fap, or a folder for pictures.",
        ),
    ],
    head: Annotated[Path, typer.Option(help="A head folder that `mien build` made.")],
    fps: Annotated[
        float | None,
        typer.Option(min=MIN_FPS, max=MAX_FPS, help="Frames a second; the timeline's by default."),
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="WIDTHxHEIGHT in px; the timeline's by default.")
    ] = None,
    yaw: Yaw = 0.0,
    pitch: Pitch = 0.0,
    background: Annotated[
        str | None,
        typer.Option(metavar="COLOUR", help="As #204060; transparent, in an .mp4 grey by default."),
    ] = None,
    json_: Json = False,
) -> None:
    """The head performs a timeline: a video, pictures, a model that moves, or its numbers."""
    from mien.io.head.head_folder import load_head
    from mien.pipelines.animate import animate_head

    width_height = None if size is None else parse_size("--size", size)
    colour = None if background is None else parse_colour("--background", background)
    with terminal_progress(json_) as progress:
        take = animate_head(
            load_head(head),
            timeline,
            output,
            fps=fps,
            size=width_height,
            yaw=_angle("--yaw", yaw),
            pitch=_angle("--pitch", pitch),
            background=colour,
            read=[head],
            progress=progress,
        )
    data = {"output": output, "frames": take.frames, "notes": take.notes}
    print_result(json_, data, f"{output}: {take.frames} frames", take.notes)


app.command()(track)
app.command()(examples)
app.command()(synthesize)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line. Returns the exit status."""
    set_up_streams()
    arguments = sys.argv[1:] if arguments is None else arguments
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    try:
        check_given(arguments)
        # An interrupted command comes back as its exit status, a finished one as None.
        return app(args=arguments, prog_name="mien", standalone_mode=False) or 0
    except Exception as error:
        if debug:
            raise
        print_error(error, as_json="--json" in arguments)
        return 2


def _angle(name: str, degrees: float) -> float:
    return radians(check_finite(name, degrees))
