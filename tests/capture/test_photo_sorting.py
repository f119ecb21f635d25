from __future__ import annotations

from pathlib import Path

import numpy as np

from expressive import exactly_detected, neutral_photo
from marbled import GENERIC, at
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.photo_sorting import sort_by_expression, sorting_notes
from mien.capture.source import CapturedView


def view(name: str, yaw: float = 0.0, **scores: float) -> CapturedView:
    """A photo whose detector saw these scores."""
    from dataclasses import replace

    seen = exactly_detected(neutral_photo(), at(yaw), GENERIC.mesh.vertices)
    blendshapes = np.array([scores.get(unit, 0.0) for unit in BLENDSHAPE_NAMES])
    assert seen.landmarks is not None
    return replace(
        seen,
        photo=replace(seen.photo, name=name, path=Path(name)),
        landmarks=replace(seen.landmarks, blendshapes=blendshapes),
    )


SMILE = {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.4}
OPEN = {"jawOpen": 0.8, "mouthLowerDownLeft": 0.5, "mouthLowerDownRight": 0.5}


def names(found: dict[str, tuple[CapturedView, ...]]) -> dict[str, list[str]]:
    return {name: [item.photo.name for item in views] for name, views in found.items()}


def test_smiles_and_speech_are_no_part_of_the_face_at_rest() -> None:
    views = [view("a", **SMILE), view("b"), view("c", **OPEN), view("d", 20), view("e", **SMILE)]
    found = sort_by_expression(views)
    assert names(found) == {"neutral": ["b", "d"], "smile": ["a", "e"], "open_mouth": ["c"]}
    assert sorting_notes(found) == (
        "a, e: another expression than the photos of the face at rest; kept as smile",
        "c: another expression than the photos of the face at rest; kept as open_mouth",
    )
    assert sorting_notes(found, kept=False)[1].endswith("of the face at rest; left out")


def test_scores_that_differ_as_they_do_between_cameras_are_one_expression() -> None:
    views = [view("a", browInnerUp=0.5), view("b", eyeSquintLeft=0.5), view("c")]
    assert names(sort_by_expression(views)) == {"neutral": ["a", "b", "c"]}
    assert sorting_notes(sort_by_expression(views)) == ()


def test_turned_faces_and_those_without_landmarks_stay() -> None:
    from dataclasses import replace

    profile = replace(view("p"), landmarks=None)
    views = [view("a"), view("b", 45, **SMILE), profile]
    assert names(sort_by_expression(views)) == {"neutral": ["a", "b", "p"]}
    assert names(sort_by_expression([profile])) == {"neutral": ["p"]}
