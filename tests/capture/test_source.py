from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import mien.assets
from mien.arrays import Array
from mien.capture import source
from mien.capture.annotations import AnnotationNames
from mien.capture.faces.detector import NO_FACE_FOUND
from mien.capture.images.photos import Photo
from mien.capture.source import NO_FACE_YET, load_capture
from mien.capture.video.picked_frames import PickedFrames
from mien.errors import EstimationError, FileFormatError, InputError

JAMES = Path(mien.assets.__file__).parent / "data" / "james"
NAMES = AnnotationNames(frozenset({"chin"}), frozenset({"left_jaw"}))


def put(path: Path, pixels: Array, **options: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).resize((300, 400)).save(path, **options)


def annotate(photo: Path, point: list[float]) -> None:
    folder = photo.parent / "annotations"
    folder.mkdir(exist_ok=True)
    (folder / f"{photo.stem}.json").write_text(json.dumps({"points": {"chin": point}}))


@pytest.fixture
def wall() -> Array:
    return np.tile(np.linspace(0, 255, 400).astype(np.uint8)[:, None, None], (1, 300, 3))


def test_folder_of_photos(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "p10.png", faces["left"])
    put(tmp_path / "p9.JPG", faces["right"], quality=95)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / ".DS_Store").write_text("hidden")
    (tmp_path / "LICENSE.txt").write_text("nobody takes this for a photo")
    annotate(tmp_path / "p10.png", [150, 320])
    seen: list[tuple[int, int]] = []
    capture = load_capture(
        tmp_path, names=NAMES, progress=lambda done, total: seen.append((done, total))
    )
    assert capture.name == tmp_path.name
    assert list(capture.expressions) == ["neutral"]
    assert [view.photo.name for view in capture.views] == ["p9.JPG", "p10.png"]
    assert all(view.landmarks is not None for view in capture.views)
    assert capture.views[0].annotations is None
    assert capture.views[1].annotations is not None
    assert list(capture.views[1].annotations.points) == ["chin"]
    assert capture.notes == ("not used, as they are no photos or lie beside photos: notes.txt",)
    assert seen == [(1, 2), (2, 2)]


def test_expression_folders(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "joy" / "a.png", faces["left"])
    put(tmp_path / "Neutral" / "a.png", faces["right"])
    (tmp_path / "empty").mkdir()
    capture = load_capture(tmp_path)
    assert list(capture.expressions) == ["neutral", "joy"]
    assert [len(views) for views in capture.expressions.values()] == [1, 1]


def test_one_photo(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "me.png", faces["left"])
    put(tmp_path / "you.png", faces["right"])
    capture = load_capture(tmp_path / "me.png")
    assert capture.name == "me"
    assert [view.photo.name for view in capture.views] == ["me.png"]
    assert not capture.notes


def test_photos_are_reduced_with_their_annotations(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "a.png", faces["left"])
    annotate(tmp_path / "a.png", [150, 320])
    (view,) = load_capture(tmp_path, names=NAMES, max_side=200).views
    assert view.photo.size == (150, 200)
    assert view.annotations is not None
    np.testing.assert_allclose(view.annotations.points["chin"], [75, 160])


def test_the_same_photo_twice(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "a.png", faces["left"])
    put(tmp_path / "b.png", faces["left"])
    put(tmp_path / "c.jpg", faces["left"], quality=90)
    Image.fromarray(faces["left"]).save(tmp_path / "d.png")
    put(tmp_path / "e.png", faces["right"])
    capture = load_capture(tmp_path)
    assert [view.photo.name for view in capture.views] == ["a.png", "e.png"]
    assert capture.notes == ("b.png, c.jpg, d.png: left out: the same photo as a.png",)


def test_photo_without_a_face_stays_beside_others(
    tmp_path: Path, faces: dict[str, Array], wall: Array
) -> None:
    put(tmp_path / "a.png", wall)
    put(tmp_path / "b.png", faces["left"])
    capture = load_capture(tmp_path)
    assert [view.photo.name for view in capture.views] == ["a.png", "b.png"]
    assert [view.marked for view in capture.views] == [False, True]
    assert capture.notes == (f"a.png: {NO_FACE_YET}",)


def test_photo_without_a_face_stays_beside_annotations(tmp_path: Path, wall: Array) -> None:
    put(tmp_path / "a.png", wall)
    put(tmp_path / "b.png", wall[::-1])
    annotate(tmp_path / "b.png", [10, 20])
    capture = load_capture(tmp_path, names=NAMES)
    assert [view.marked for view in capture.views] == [False, True]


def test_photo_without_a_face_is_left_out_of_an_expression_without_faces(
    tmp_path: Path, faces: dict[str, Array], wall: Array
) -> None:
    put(tmp_path / "neutral" / "a.png", faces["left"])
    put(tmp_path / "joy" / "b.png", wall)
    capture = load_capture(tmp_path)
    assert list(capture.expressions) == ["neutral"]
    assert capture.notes == (f"b.png: left out: {NO_FACE_FOUND}",)


def test_the_same_photo_without_a_face_twice(
    tmp_path: Path, faces: dict[str, Array], wall: Array
) -> None:
    for name, pixels in (("a", faces["left"]), ("b", wall), ("c", wall)):
        put(tmp_path / f"{name}.png", pixels)
    capture = load_capture(tmp_path)
    assert [view.photo.name for view in capture.views] == ["a.png", "b.png"]
    assert capture.notes[0] == "c.png: left out: the same photo as b.png"


def test_face_too_small_is_left_out(tmp_path: Path, faces: dict[str, Array]) -> None:
    """A head of so few pixels cannot be placed by the others either."""
    tiny = np.full((400, 300, 3), 128, np.uint8)
    small = np.asarray(Image.fromarray(faces["left"]).resize((48, 64)))
    tiny[100:164, 100:148] = small
    put(tmp_path / "a.png", faces["left"])
    put(tmp_path / "b.png", tiny)
    capture = load_capture(tmp_path)
    assert [view.photo.name for view in capture.views] == ["a.png"]
    assert capture.notes[0].startswith("b.png: left out: the face is too small")


def test_annotations_stand_in_for_the_detector(tmp_path: Path, wall: Array) -> None:
    put(tmp_path / "profile.png", wall)
    annotate(tmp_path / "profile.png", [10, 20])
    capture = load_capture(tmp_path, names=NAMES)
    assert capture.views[0].landmarks is None
    assert capture.views[0].annotations is not None
    assert capture.notes[0].endswith("; annotations only")


def test_no_face_at_all(tmp_path: Path, wall: Array) -> None:
    put(tmp_path / "b.png", wall)
    message = r"no photo shows a face that can be used \(b\.png: left out: no face found"
    with pytest.raises(EstimationError, match=message):
        load_capture(tmp_path)


def test_annotations_without_a_photo(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "a.png", faces["left"])
    annotate(tmp_path / "old_name.png", [1, 1])
    capture = load_capture(tmp_path, names=NAMES)
    assert capture.notes == ("annotations/old_name.json: there is no photo of that name",)


def test_bad_annotations_end_the_load(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "a.png", faces["left"])
    annotate(tmp_path / "a.png", [301, 1])
    with pytest.raises(FileFormatError, match=r"a\.json: points\.chin: expected a place within"):
        load_capture(tmp_path, names=NAMES)


def test_one_viewpoint_is_noted(tmp_path: Path, faces: dict[str, Array]) -> None:
    put(tmp_path / "a.png", faces["left"])
    put(tmp_path / "b.png", np.roll(faces["left"], 40, axis=1))
    capture = load_capture(tmp_path)
    assert len(capture.views) == 2
    assert capture.notes[0].startswith("neutral: its 2 photos look from nearly one side (yaw spans")


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected photos in this folder or in folders within"):
        load_capture(tmp_path)
    with pytest.raises(
        InputError, match="expected a photo, a video or a folder of photos, got not"
    ):
        load_capture(tmp_path / "absent")
    (tmp_path / "a.jpg").write_text("no photo")
    with pytest.raises(FileFormatError, match=r"a\.jpg: expected an image"):
        load_capture(tmp_path)


def test_photos_that_ship_with_the_package() -> None:
    capture = load_capture(JAMES)
    assert [view.photo.name for view in capture.views] == ["photo_left.png", "photo_right.png"]
    assert all(view.landmarks is not None for view in capture.views)


def test_video(shared: Path) -> None:
    path = shared / "data/videos/single_face.mp4"
    capture = load_capture(path, frames=2, expressions=0)
    assert capture.name == "single_face"
    assert list(capture.expressions) == ["neutral"]
    assert all(view.photo.stem.startswith("frame_") for view in capture.views)
    assert all(view.photo.path == path for view in capture.views)


def test_expressions_of_a_video_without_a_face_are_left_out(
    tmp_path: Path, faces: dict[str, Array], wall: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A face of the fast detection may not be confirmed by the full one."""
    asked: list[int | None] = []

    def pick(path: Path, *, expressions: int | None, **options: object) -> PickedFrames:
        asked.append(expressions)
        shown = {"neutral": faces["left"], "smile": faces["right"], "frown": wall}
        return PickedFrames(
            {name: (Photo(f"{name}.png", path, pixels),) for name, pixels in shown.items()},
            ("HDR video",),
        )

    monkeypatch.setattr(source, "pick_frames", pick)
    (tmp_path / "a.mp4").write_bytes(b"a clip")
    capture = load_capture(tmp_path / "a.mp4", expressions=3)
    assert asked == [3]
    assert list(capture.expressions) == ["neutral", "smile"]
    assert capture.notes == ("a.mp4: HDR video", f"frown.png: left out: {NO_FACE_FOUND}")


def test_seven_views_of_a_scan(shared: Path) -> None:
    capture = load_capture(shared / "data/emily/renders_mentalray", max_side=800)
    assert len(capture.views) == 7
    assert [note for note in capture.notes if "scaled from" not in note] == []


def test_one_viewpoint_is_noted_of_a_photo_on_its_head(
    tmp_path: Path, faces: dict[str, Array]
) -> None:
    put(tmp_path / "a.png", faces["left"])
    put(tmp_path / "b.png", np.rot90(np.roll(faces["left"], 40, axis=1), 2))
    note = load_capture(tmp_path).notes[-1]
    assert note.startswith("neutral: its 2 photos look from nearly one side (yaw spans ")
    spans = [float(word) for word in note.split("yaw spans ")[1].split() if word.isdecimal()]
    assert max(spans) <= 3
