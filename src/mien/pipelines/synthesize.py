"""`mien synthesize`: an expression's picture from feature points, or from the face of a photo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mien.io.examples.example_folder import load_examples
from mien.io.examples.weights_json import save_weights
from mien.io.files.image import save_image
from mien.io.landmarks.points_file import check_points_kind, save_feature_points
from mien.pipelines.synthesize_target import (
    HeadChoice,
    SynthesisTarget,
    check_request,
    target_from_photo,
    target_from_points,
)
from mien.progress import Progress, no_progress
from mien.synthesis.examples.example_set import ExampleSet
from mien.synthesis.inference.input_checks import face_width
from mien.synthesis.synthesizer import Synthesis, SynthesisOptions, Synthesizer

__all__ = ["HULL_TOLERANCE", "SynthesizedPicture", "hull_note", "synthesize_expression"]

READING, FINDING, DRAWING = "Reading the examples", "Finding the face", "Drawing"

HULL_TOLERANCE = 0.01
"""Face widths by which a subregion may leave the hull of the examples without a note.

Of held-out frames of two clips, 40 examples each, 5 in 100 subregions leave it so far, in a fifth
of the frames; their PSNR is 1 to 2 dB below the same subregion's usual one, and from
0.0125 on 2 to 4 dB.
"""


@dataclass(frozen=True)
class SynthesizedPicture:
    """An expression that was drawn.

    Attributes:
        synthesis: the picture and its coefficients.
        hull_px: of each subregion, as `Synthesis.hull_px`.
        notes: what the user should know.
    """

    synthesis: Synthesis
    hull_px: dict[str, float]
    notes: tuple[str, ...]


def synthesize_expression(
    folder: str | Path,
    output: str | Path,
    *,
    points: str | Path | None = None,
    photo: str | Path | None = None,
    weights: str | Path | None = None,
    save_points: str | Path | None = None,
    options: SynthesisOptions | None = None,
    head: HeadChoice = "auto",
    face: int | None = None,
    progress: Progress | None = None,
) -> SynthesizedPicture:
    """Draw an expression of the person in an example folder and write the picture.

    Args:
        folder: of the examples.
        output: .png or .jpg.
        points: a file of feature points, px of the neutral photo; or
        photo: a file of one whose face has the expression; the picture gets its size, and the head
            its position.
        weights: W.json to write, which examples made which subregion.
        save_points: .json, .tem or .pts to write, all points of the picture, px.
        options: as for `Synthesizer`.
        head: of `points`, as for `target_from_points`.
        face: of `photo`, which one; the largest unless given.
        progress: called with the stage, steps done and their total.

    Raises:
        InputError: neither or both of points and photo, a place that cannot be written, points that
            are of another picture.
        FileFormatError: as `load_examples`, `target_from_points`, `target_from_photo`.
        EstimationError: as `load_examples`, `target_from_points`, `target_from_photo`.
    """
    report = progress or no_progress
    check_request(folder, points, photo, output, weights, save_points)
    if save_points is not None:
        check_points_kind(save_points)
    report(READING, 0, 0)
    synthesizer = Synthesizer(load_examples(folder), options)
    report(READING, 1, 1)
    report(FINDING if photo else DRAWING, 0, 0)
    if photo is not None:
        target = target_from_photo(synthesizer, photo, face=face)
        report(FINDING, 1, 1)
    else:
        assert points is not None
        target = target_from_points(synthesizer, points, head=head)
    result = _draw(synthesizer, target)
    save_image(output, result.synthesis.image)
    if weights is not None:
        synthesis = result.synthesis
        save_weights(weights, synthesizer.examples, synthesis.coefficients, synthesis.hull_px)
    if save_points is not None:
        save_feature_points(save_points, synthesizer.examples.layout, result.synthesis.points)
    report(DRAWING, 1, 1)
    return result


def hull_note(examples: ExampleSet, hull_px: dict[str, float]) -> str | None:
    """Which subregions lie outside of the hull of the examples, the worst first.

    Args:
        examples: of the person.
        hull_px: of each subregion, as `Synthesis.hull_px`.
    """
    width = face_width(examples.layout, examples.neutral.points)
    parts = [
        f"{name.replace('_', ' ')} {px:.1f} px ({px / width:.1%})"
        for name, px in sorted(hull_px.items(), key=lambda item: -item[1])
        if px > HULL_TOLERANCE * width
    ]
    if not parts:
        return None
    bound = f"more than {HULL_TOLERANCE:.0%} of the face's width"
    return f"beyond what the examples show, by {bound}: {', '.join(parts)}"


def _draw(synthesizer: Synthesizer, target: SynthesisTarget) -> SynthesizedPicture:
    synthesis = synthesizer.synthesize(target.points, motion=target.motion, size=target.size)
    names = synthesizer.examples.subregions.names
    hull_px = dict(zip(names, synthesis.hull_px.tolist(), strict=True))
    beyond = hull_note(synthesizer.examples, hull_px)
    notes = (*target.notes, *([beyond] if beyond else []))
    return SynthesizedPicture(synthesis, hull_px, notes)
