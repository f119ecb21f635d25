"""`mien synthesize` of a head: an expression from points in space, or from the face of a photo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError
from mien.head import Head
from mien.io.examples.weights_json import save_shares
from mien.io.files.image import save_image
from mien.io.head.head_folder import load_head
from mien.io.landmarks.points_json import load_points_json
from mien.pipelines.synthesize_target import check_request
from mien.progress import Progress, no_progress
from mien.render.picture import HeadRenderer
from mien.synthesis.heads.synthesizer import HeadSynthesis, HeadSynthesizer
from mien.synthesis.synthesizer import SynthesisOptions

__all__ = ["HULL_TOLERANCE_MM", "HeadView", "SynthesizedHeadPicture", "synthesize_head"]

READING, FINDING, DRAWING = "Reading the head", "Finding the face", "Drawing"

HULL_TOLERANCE_MM = 2.0
"""By so much a subregion may leave what the expressions show before it is told of."""
_FARTHEST_MM = 80.0
"""No jaw opens so far: farther from where they are at rest, points are of another space."""


@dataclass(frozen=True)
class HeadView:
    """From where a head is seen.

    Attributes:
        yaw: radians, as docs/reference/conventions.md says.
        pitch: radians, as docs/reference/conventions.md says.
        size: width and height, px.
        background: sRGB; transparent unless given. Of a photo's head it is the photo.
    """

    yaw: float = 0.0
    pitch: float = 0.0
    size: tuple[int, int] = (800, 1000)
    background: tuple[int, int, int] | None = None


@dataclass(frozen=True)
class SynthesizedHeadPicture:
    """What came of it.

    Attributes:
        size: width and height of the picture, px.
        synthesis: the face and its shares.
        hull_mm: of each subregion, as `HeadSynthesis.hull_mm`.
        notes: what the user should know.
    """

    size: tuple[int, int]
    synthesis: HeadSynthesis
    hull_mm: dict[str, float]
    notes: tuple[str, ...]


def synthesize_head(
    folder: str | Path,
    output: str | Path,
    *,
    points: str | Path | None = None,
    photo: str | Path | None = None,
    weights: str | Path | None = None,
    options: SynthesisOptions | None = None,
    warp: bool = True,
    view: HeadView | None = None,
    progress: Progress | None = None,
) -> SynthesizedHeadPicture:
    """Make an expression of a head and write a picture of it.

    Args:
        folder: of the head.
        output: .png or .jpg.
        points: a file of feature points, mm, head space; or
        photo: of the same person, whose face has the expression; the head is drawn over it, where
            it is seen there.
        weights: W.json, which expressions made which subregion.
        options: as for `HeadSynthesizer`.
        warp: as for `HeadSynthesizer`.
        view: of `points`.
        progress: told the stage, steps done and their total.

    Raises:
        InputError: neither or both of points and photo, a place that cannot be written, points that
            cannot be meant.
        FileFormatError: as `load_head`, `load_points_json`.
        EstimationError: no face in the photo that this head fits.
    """
    tell = progress or no_progress
    check_request(folder, points, photo, output, weights)
    tell(READING, 0, 0)
    head = load_head(folder)
    tell(READING, 1, 1)
    if photo is not None:
        tell(FINDING, 0, 0)
        made = _of_photo(head, photo, options, warp)
        tell(FINDING, 1, 1)
    else:
        assert points is not None
        tell(DRAWING, 0, 0)
        made = _of_points(head, points, options, warp, view or HeadView())
        tell(DRAWING, 1, 1)
    save_image(output, made.picture)
    if weights is not None:
        _write_weights(weights, made.synthesizer, head, made.synthesis)
    names = made.synthesizer.subregions.names
    hull_mm = dict(zip(names, made.synthesis.hull_mm.tolist(), strict=True))
    height, width = made.picture.shape[:2]
    notes = (*made.notes, *_hull_notes(hull_mm))
    return SynthesizedHeadPicture((width, height), made.synthesis, hull_mm, notes)


@dataclass(frozen=True)
class _Made:
    synthesizer: HeadSynthesizer
    synthesis: HeadSynthesis
    picture: Array
    notes: tuple[str, ...] = ()


def _of_points(
    head: Head,
    path: str | Path,
    options: SynthesisOptions | None,
    warp: bool,
    view: HeadView,
) -> _Made:
    synthesizer = HeadSynthesizer(head, options, warp=warp)
    known, positions = _read_points(path, synthesizer.layout)
    _check_points(path, synthesizer, known, positions)
    made = synthesizer.synthesize(synthesizer.complete(known, positions))
    renderer = HeadRenderer(head, rig=synthesizer.rig)
    camera = renderer.camera(view.yaw, view.pitch, size=view.size)
    picture = renderer.draw_posed(made.face, camera, background=view.background)
    return _Made(synthesizer, made, picture)


def _of_photo(head: Head, path: str | Path, options: SynthesisOptions | None, warp: bool) -> _Made:
    from mien.capture.images.photos import load_photo
    from mien.pipelines.head_in_photo import find_head

    photo = load_photo(path)
    found = find_head(head, photo)
    notes = [f"{photo.name}: {note}" for note in photo.notes]
    synthesizer = HeadSynthesizer(head, options, warp=warp, rig=found.rig)
    made = synthesizer.synthesize(found.points)
    renderer = HeadRenderer(head, rig=synthesizer.rig)
    picture = renderer.draw_posed(made.face, found.camera, background=photo.pixels)
    return _Made(synthesizer, made, picture, (*notes, *found.notes))


def _read_points(
    path: str | Path, layout: FeatureLayout
) -> tuple[Int[Array, " k"], Float[Array, "k 3"]]:
    suffix = Path(path).suffix
    if suffix.lower() != ".json":
        raise InputError(path, "a .json of points in space", suffix or "no suffix")
    named = load_points_json(path, layout, axes=3)
    return np.array([layout.index(name) for name in named]), np.array(list(named.values()))


def _check_points(
    path: str | Path, synthesizer: HeadSynthesizer, known: Int[Array, " k"], positions: Array
) -> None:
    """Raises: InputError: points far from the face, or on its other side."""
    layout, rest = synthesizer.layout, synthesizer.examples[0]
    away = np.linalg.norm(positions - rest[known], axis=1)
    across = np.linalg.norm(positions - rest[layout.mirror[known]], axis=1)
    if (across**2).sum() < (away**2).sum():
        expected = "right and left as the subject has them, x to the subject's left"
        raise InputError(path, expected, "points that fit the face only when mirrored")
    if away.max() > _FARTHEST_MM:
        worst = int(away.argmax())
        place = ", ".join(f"{number:g}" for number in positions[worst])
        expected = "mm in the head's own space, near the face"
        raise InputError(path, expected, f"{layout.names[known[worst]]} at {place}")


def _write_weights(
    path: str | Path, synthesizer: HeadSynthesizer, head: Head, made: HeadSynthesis
) -> None:
    names = synthesizer.rig.names
    photos = [", ".join(view.photo for view in head.expressions[name].views) for name in names]
    save_shares(
        path,
        layout=synthesizer.layout.name,
        sources=dict(zip(names, photos, strict=True)),
        subregions=synthesizer.subregions.names,
        coefficients=made.coefficients,
        hull={"hull_mm": made.hull_mm},
    )


def _hull_notes(hull_mm: dict[str, float]) -> tuple[str, ...]:
    beyond = sorted(hull_mm.items(), key=lambda item: -item[1])
    told = [
        f"{name.replace('_', ' ')} by {mm:.1f} mm" for name, mm in beyond if mm > HULL_TOLERANCE_MM
    ]
    return (f"beyond what the expressions show: {', '.join(told)}",) if told else ()
