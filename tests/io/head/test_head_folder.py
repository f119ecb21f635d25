from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from documents import put
from mien.errors import FileFormatError, InputError
from mien.head import SHADING, Head
from mien.io.head.head_folder import check_head_place, load_head, save_head
from mien.io.head.head_json import HEAD_FORMAT

JOY = ("expressions", "joy", "cameras", 0)


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def photos(*names: str) -> list[tuple[str, np.ndarray]]:
    return [(name, np.full((8, 6, 3), 40 * i, np.uint8)) for i, name in enumerate(names, 1)]


def edit_json(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    path = folder / "head.json"
    data = json.loads(path.read_text("utf-8"))
    change(data)
    path.write_text(json.dumps(data), "utf-8")


@pytest.fixture
def saved(small_head: Head, tmp_path: Path) -> Path:
    save_head(small_head, tmp_path / "head")
    return tmp_path / "head"


def test_what_is_saved_round_trips(small_head: Head, saved: Path) -> None:
    loaded = load_head(saved)
    for name in ("subject", "unit_names", "left_out", "verdict", "generator"):
        assert getattr(loaded, name) == getattr(small_head, name)
    for name in ("vertices", "triangles", "uvs", "uv_triangles", "part"):
        np.testing.assert_array_equal(getattr(loaded.mesh, name), getattr(small_head.mesh, name))
    assert loaded.mesh.part_names == small_head.mesh.part_names
    np.testing.assert_array_equal(loaded.units, small_head.units)
    np.testing.assert_array_equal(loaded.uncertainty_mm, small_head.uncertainty_mm)
    for name, texture in small_head.textures.items():
        np.testing.assert_array_equal(loaded.textures[name], texture)
    for name, expression in small_head.expressions.items():
        np.testing.assert_array_equal(loaded.expressions[name].vertices, expression.vertices)
        assert loaded.expressions[name].texture == expression.texture


def expressive(head: Head) -> Head:
    """The head with all that an expression can have."""
    joy = replace(
        head.expressions["joy"],
        units={"jawOpen": 0.25, "tongueOut": -0.125},
        gaze=np.array([[0.1, -0.2], [1 / 3, 0]]),
        views=tuple(replace(v, gains=np.array([1.1, 0.9, 1 / 3])) for v in head.views[:1]),
    )
    shading = {"eyes": (0.1, 1 / 3, -2.0), "teeth": (1.0, 0.0, 0.5)}
    return replace(head, expressions={**head.expressions, "joy": joy}, shading=shading)


def test_what_expressions_are_made_of_round_trips(small_head: Head, tmp_path: Path) -> None:
    head = expressive(small_head)
    save_head(head, tmp_path / "h")
    loaded = load_head(tmp_path / "h")
    assert loaded.shading == head.shading
    for name, expression in head.expressions.items():
        found = loaded.expressions[name]
        assert found.units == expression.units
        np.testing.assert_array_equal(found.gaze, expression.gaze)
        for view, kept in zip(expression.views, found.views, strict=True):
            np.testing.assert_array_equal(kept.gains, view.gains)


def test_a_head_of_an_older_mien_loads(small_head: Head, tmp_path: Path) -> None:
    save_head(expressive(small_head), tmp_path / "h")

    def age(data: dict[str, Any]) -> None:
        del data["shading"], data["verdict"]
        for expression in data["expressions"].values():
            del expression["units"], expression["gaze_rad"]
            for camera in expression["cameras"]:
                del camera["gains"]

    edit_json(tmp_path / "h", age)
    loaded = load_head(tmp_path / "h")
    assert loaded.shading == SHADING
    assert loaded.verdict is None
    for expression in loaded.expressions.values():
        assert expression.units == {}
        np.testing.assert_array_equal(expression.gaze, np.zeros((2, 2)))
    for view in loaded.views:
        np.testing.assert_array_equal(view.gains, np.ones(3))


def test_cameras_round_trip_to_the_last_bit(small_head: Head, saved: Path) -> None:
    for loaded, view in zip(load_head(saved).views, small_head.views, strict=True):
        for name in ("width", "height", "focal_px"):
            assert getattr(loaded.camera, name) == getattr(view.camera, name)
        for name in ("R_cam_head", "t_cam_head", "principal_px"):
            np.testing.assert_array_equal(getattr(loaded.camera, name), getattr(view.camera, name))
        assert (loaded.photo, loaded.rms_px, loaded.points_used, loaded.outliers) == (
            view.photo,
            view.rms_px,
            view.points_used,
            view.outliers,
        )


def test_the_folder_is_readable_without_mien(small_head: Head, tmp_path: Path) -> None:
    save_head(small_head, tmp_path / "h", photos=photos("front.png", "joy/front.heic"))
    data = json.loads((tmp_path / "h" / "head.json").read_text("utf-8"))
    camera = data["expressions"]["neutral"]["cameras"][0]
    assert set(camera) >= {
        "photo",
        "width",
        "height",
        "focal_px",
        "principal_px",
        "R_cam_head",
        "t_cam_head_mm",
        "rms_px",
        "points_used",
    }
    with np.load(tmp_path / "h" / "geometry.npz", allow_pickle=False) as arrays:
        kinds = {name: (arrays[name].dtype.name, arrays[name].shape) for name in arrays.files}
    count, faces, corners = (
        len(array)
        for array in (small_head.mesh.vertices, small_head.mesh.triangles, small_head.mesh.uvs)
    )
    assert kinds == {
        "vertices/neutral": ("float32", (count, 3)),
        "vertices/joy": ("float32", (count, 3)),
        "triangles": ("int32", (faces, 3)),
        "uvs": ("float32", (corners, 2)),
        "uv_triangles": ("int32", (faces, 3)),
        "part": ("uint8", (faces,)),
        "uncertainty_mm": ("float32", (count,)),
        "unit_offsets": ("float32", (3, count, 3)),
    }
    for place in [*data["textures"].values(), *data["photos"].values()]:
        Image.open(tmp_path / "h" / place).verify()


def test_photos_and_annotations_are_kept(small_head: Head, tmp_path: Path) -> None:
    annotation = {"photo": "front.png", "size": [6, 8], "points": {"nose_tip": [3.5, 4]}}
    save_head(
        small_head,
        tmp_path / "h",
        photos=photos("front.png", "joy/front.heic"),
        annotations={"front": annotation, "joy/front": {"points": {}}},
    )
    data = json.loads((tmp_path / "h" / "head.json").read_text("utf-8"))
    assert data["photos"] == {
        "front.png": "photos/front.png",
        "joy/front.heic": "photos/joy/front.heic.jpg",
    }
    front = np.asarray(Image.open(tmp_path / "h" / "photos" / "front.png"))
    np.testing.assert_array_equal(front, np.full((8, 6, 3), 40))
    kept = json.loads((tmp_path / "h" / "annotations" / "front.json").read_text("utf-8"))
    assert kept == annotation
    assert (tmp_path / "h" / "annotations" / "joy" / "front.json").is_file()


@pytest.mark.parametrize("name", ["../x.png", "/x.png", "a\\..\\x.png", ""])
def test_a_photo_cannot_leave_the_folder(small_head: Head, tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="photos: expected names that stay inside the folder"):
        save_head(small_head, tmp_path / "h", photos=photos(name))
    assert list(tmp_path.iterdir()) == []


def test_a_photos_name_is_taken_once(small_head: Head, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"photos: expected every name once, got a\.png twice"):
        save_head(small_head, tmp_path / "h", photos=photos("a.png", "b.png", "a.png"))


def test_the_same_head_gives_the_same_bytes(small_head: Head, tmp_path: Path) -> None:
    for name in "ab":
        save_head(small_head, tmp_path / name, photos=photos("front.png", "side.jpg"))
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    with zipfile.ZipFile(tmp_path / "a" / "geometry.npz") as archive:
        assert {member.date_time[0] for member in archive.infolist()} == {1980}, "not today's date"


def test_a_loaded_head_saves_to_the_same_bytes(saved: Path, tmp_path: Path) -> None:
    save_head(load_head(saved), tmp_path / "again")
    assert contents(tmp_path / "again") == contents(saved)


def test_a_failed_save_leaves_the_old_head(small_head: Head, saved: Path) -> None:
    before = contents(saved)

    def failing() -> Any:
        yield from photos("front.png")
        raise RuntimeError("the photo went away")

    with pytest.raises(RuntimeError, match="went away"):
        save_head(small_head, saved, photos=failing())
    assert contents(saved) == before
    assert [path.name for path in saved.parent.iterdir()] == ["head"]


def test_saving_again_replaces_all_that_mien_wrote(small_head: Head, saved: Path) -> None:
    save_head(small_head, saved, photos=photos("of_the_last_build.png"))
    save_head(small_head, saved)
    assert not (saved / "photos").exists()
    assert [path.name for path in saved.parent.iterdir()] == ["head"]


def test_saving_again_keeps_what_is_not_miens(small_head: Head, saved: Path) -> None:
    (saved / "notes.txt").write_text("mine")
    (saved / "takes").mkdir()
    (saved / "takes" / "take.mp4").write_bytes(b"film")
    for _ in range(2):
        save_head(small_head, saved)
        assert (saved / "notes.txt").read_text() == "mine"
        assert (saved / "takes" / "take.mp4").read_bytes() == b"film"


def test_a_folder_of_something_else_is_never_replaced(small_head: Head, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for refuse in (lambda: save_head(small_head, tmp_path), lambda: check_head_place(tmp_path)):
        with pytest.raises(InputError, match="a folder with other things in it"):
            refuse()
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"format": "other"}'])
def test_a_folder_with_some_other_head_json_is_never_replaced(
    small_head: Head, tmp_path: Path, text: str
) -> None:
    (tmp_path / "head.json").write_text(text)
    with pytest.raises(InputError, match="a folder with other things in it"):
        save_head(small_head, tmp_path)
    assert (tmp_path / "head.json").read_text() == text


def test_a_newer_head_is_refused_and_says_so(saved: Path) -> None:
    edit_json(
        saved, lambda data: data.update(version=HEAD_FORMAT.version + 1, generator="mien 9.0")
    )
    with pytest.raises(FileFormatError, match=r"head\.json: version: 2 .*newer mien \(mien 9.0\)"):
        load_head(saved)
    check_head_place(saved)  # but it is a head folder, so that a new build may replace it


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a head folder .* got nothing at that place"):
        load_head(tmp_path / "absent")
    with pytest.raises(FileFormatError, match="is this a head folder"):
        load_head(tmp_path)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("head.json", "head.json: there is no such file"),
        ("geometry.npz", "geometry.npz: there is no such file"),
        ("textures/atlas.png", "atlas.png: there is no such file"),
    ],
)
def test_a_missing_file_is_named(saved: Path, file: str, message: str) -> None:
    (saved / file).unlink()
    with pytest.raises(FileFormatError, match=message):
        load_head(saved)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (
            "head.json",
            r"head\.json: (line \d+, column \d+: expected JSON: |expected JSON in UTF-8)",
        ),
        ("geometry.npz", r"geometry\.npz: not a readable \.npz file"),
        ("textures/atlas.png", r"atlas\.png: expected an? .*image"),
    ],
)
@pytest.mark.parametrize("keep", [0.0, 0.5])
def test_a_truncated_file_is_named(saved: Path, file: str, message: str, keep: float) -> None:
    data = (saved / file).read_bytes()
    (saved / file).write_bytes(data[: int(keep * len(data))])
    with pytest.raises(FileFormatError, match=message):
        load_head(saved)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.update(format="mien track"), "format: expected 'mien head'"),
        (lambda data: data.update(version="one"), "version: expected a whole number"),
        (lambda data: data.pop("subject"), "subject: missing"),
        (lambda data: data["expressions"].pop("neutral"), "expressions.neutral: missing"),
        (lambda data: data["face_units"].pop(), "unit_offsets: expected shape"),
        (lambda data: data["parts"].append(3), r"parts\[3\]: expected text, found a number"),
        (lambda data: data["textures"].update(atlas=3), "textures.atlas: expected text"),
        (
            lambda data: data["expressions"]["joy"]["cameras"][0].pop("focal_px"),
            r"expressions\.joy\.cameras\[0\]\.focal_px: missing",
        ),
        (
            lambda data: data["expressions"]["joy"]["cameras"][0].update(R_cam_head=[[1, 0], [0]]),
            r"cameras\[0\]\.R_cam_head: expected 3 lists, found 2",
        ),
        (
            lambda data: data["expressions"]["joy"]["cameras"][0].update(focal_px=-1),
            "focal_px: expected a number above 0",
        ),
        (
            lambda data: data["expressions"].update(awe={"texture": "atlas", "cameras": []}),
            r"geometry\.npz: vertices/awe: missing",
        ),
        (
            lambda data: data["expressions"]["joy"].update(units={"jawOpen": "wide"}),
            r"expressions\.joy\.units\.jawOpen: expected a number, found text 'wide'",
        ),
        (
            lambda data: data["expressions"]["joy"].update(units=[1]),
            r"expressions\.joy\.units: expected an object",
        ),
        (
            lambda data: data["expressions"]["joy"]["gaze_rad"].pop("left"),
            r"expressions\.joy\.gaze_rad\.left: missing",
        ),
        (
            lambda data: data["expressions"]["joy"]["gaze_rad"]["right"].update(yaw="left"),
            r"expressions\.joy\.gaze_rad\.right\.yaw: expected a number",
        ),
        (
            lambda data: data["shading"].update(eyes=[1, 2]),
            r"shading\.eyes: expected 3 numbers, found 2",
        ),
        (lambda data: data["shading"].pop("teeth"), "shading.teeth: missing"),
        (
            lambda data: data["verdict"].update(grade="fine"),
            r"verdict\.grade: unknown grade 'fine'",
        ),
        (lambda data: data["verdict"].pop("reasons"), "verdict.reasons: missing"),
        (
            lambda data: data["expressions"]["joy"]["cameras"][0].update(gains=[1, 0, 1]),
            "gains: expected numbers above 0",
        ),
        (
            lambda data: data["textures"].update(atlas="../../secret.png"),
            "textures.atlas: expected a path inside the folder",
        ),
    ],
)
def test_a_wrong_entry_is_named(
    saved: Path, change: Callable[[dict[str, Any]], object], message: str
) -> None:
    edit_json(saved, change)
    with pytest.raises(FileFormatError, match=message):
        load_head(saved)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("version", to=-5), "version: expected a number above 0"),
        (put("version", to=1.5), "version: expected a whole number, found a number"),
        (put("version", to=True), "version: expected a whole number, found true or false"),
        (put("units", "length", to="inch"), "units.length: unknown length 'inch'; expected one of"),
        (put("face_units", 1, to="eyeLookUpLeft"), "face_units: 'eyeLookUpLeft' appears twice"),
        (put("parts", 1, to="skin"), "parts: 'skin' appears twice"),
        (put("parts", to=["skin"]), "part: expected whole numbers from 0 to 0, found 1"),
        (put(*JOY, "width", to=10**30), r"cameras\[0\]\.width: expected a number above 0 and at"),
        (put(*JOY, "height", to=1e5), r"cameras\[0\]\.height: expected a whole number"),
        (put(*JOY, "focal_px", to=10**400), r"cameras\[0\]\.focal_px: expected a finite number"),
        (put(*JOY, "rms_px", to=10**400), r"cameras\[0\]\.rms_px: expected a finite number"),
        (put(*JOY, "rms_px", to=float("nan")), r"cameras\[0\]\.rms_px: expected a finite number"),
        (put(*JOY, "R_cam_head", to=np.eye(3).tolist()[::-1]), "expected a rotation matrix"),
        (put("expressions", "joy", "units", to={"jawOpen": 50}), "jawOpen: expected a number from"),
        (put("textures", "atlas", to="textures/a\0.png"), "expected a path inside the folder"),
    ],
)
def test_values_that_no_head_has_raise(
    saved: Path, change: Callable[[dict[str, Any]], object], message: str
) -> None:
    edit_json(saved, change)
    with pytest.raises(FileFormatError, match=message) as caught:
        load_head(saved)
    assert str(caught.value).startswith(str(saved))


def test_deep_and_long_and_doubled_json_raises(saved: Path, small_head: Head) -> None:
    """One reader reads it, whatever is to be done with it; what is no head's is not replaced."""
    path = saved / "head.json"
    for text, problem in (
        ("[" * 200_000, "expected lists and objects at most 64 deep"),
        ('{"a": ' + "9" * 5000 + "}", "line 1: expected numbers of at most 1000 digits"),
        ('{"format": "mien head", "format": "mien head"}', "format: the name appears twice"),
    ):
        path.write_text(text)
        with pytest.raises(FileFormatError) as caught:
            load_head(saved)
        assert str(caught.value).startswith(f"{path}: {problem}")
        with pytest.raises(InputError, match="a folder with other things in it"):
            check_head_place(saved)


def change_arrays(folder: Path, **changed: Any) -> None:
    with np.load(folder / "geometry.npz") as file:
        arrays = dict(file) | {name.replace("__", "/"): array for name, array in changed.items()}
    np.savez_compressed(folder / "geometry.npz", **arrays)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("triangles", lambda a: a + 0.5, "triangles: expected whole numbers from 0 to "),
        ("triangles", lambda a: a + 1000, "triangles: expected whole numbers from 0 to "),
        ("triangles", lambda a: a - 1, "triangles: expected whole numbers from 0 to .* found -1"),
        (
            "uv_triangles",
            lambda a: a.astype(np.int64) + 2**32,
            "uv_triangles: expected whole numbers",
        ),
        ("part", lambda a: a.astype(int) + 256, "part: expected whole numbers from 0 to 2"),
        ("vertices/joy", lambda a: a + 0j, "vertices/joy: expected numbers, found complex"),
        ("vertices/joy", lambda a: a.astype(str), "vertices/joy: expected numbers, found <U"),
        ("vertices/joy", lambda a: a * np.nan, "vertices/joy: expected finite numbers, found nan"),
        (
            "vertices/joy",
            lambda a: a * 0,
            "vertices/joy: expected a part with some extent, found 's",
        ),
        (
            "vertices/neutral",
            lambda a: a * [1, 1, 0],
            "vertices/neutral: expected a part with some",
        ),
        (
            "vertices/neutral",
            lambda a: a * 1e9,
            "vertices/neutral: expected numbers from -10000 to",
        ),
        ("vertices/neutral", lambda a: a[:-1], "vertices/joy: expected shape"),
        ("uvs", lambda a: a + 1, "uvs: expected numbers from 0 to 1, found 1 to 2"),
        ("unit_offsets", lambda a: a[:, :, :2], "unit_offsets: expected shape"),
        ("uncertainty_mm", lambda a: a[:-1], "uncertainty_mm: expected shape"),
    ],
)
def test_arrays_that_no_head_has_raise(
    saved: Path, name: str, change: Callable[[np.ndarray], np.ndarray], message: str
) -> None:
    with np.load(saved / "geometry.npz") as file:
        array = change(file[name])
    change_arrays(saved, **{name: array})
    with pytest.raises(FileFormatError, match=rf"geometry\.npz: {message}"):
        load_head(saved)


def test_arrays_of_other_widths_are_the_same(saved: Path, small_head: Head) -> None:
    with np.load(saved / "geometry.npz") as file:
        wider = {name: file[name].astype("f8") for name in file.files}
    change_arrays(saved, **wider)
    np.testing.assert_array_equal(load_head(saved).mesh.triangles, small_head.mesh.triangles)


def test_textures_that_are_mixed_are_of_one_size(saved: Path) -> None:
    path = saved / "textures" / "joy.png"
    Image.new("RGB", (256, 256)).save(path)
    with pytest.raises(FileFormatError) as caught:
        load_head(saved)
    assert str(caught.value) == f"{path}: expected 64x32 px as neutral's texture, found 256x256"


def test_neutral_has_a_texture(saved: Path) -> None:
    edit_json(saved, put("textures", to={}))
    with pytest.raises(FileFormatError) as caught:
        load_head(saved)
    problem = "expressions.neutral.texture: expected one of the textures, found 'atlas' of none"
    assert str(caught.value) == f"{saved / 'head.json'}: {problem}"


def test_a_head_of_the_generic_topology_has_the_generic_names(
    generic: Head, tmp_path: Path
) -> None:
    save_head(generic, tmp_path / "h")
    edit_json(tmp_path / "h", put("parts", 1, to="left_eye"))
    with pytest.raises(FileFormatError, match=r"head\.json: parts: expected .*, found 'left_eye'"):
        load_head(tmp_path / "h")
    save_head(generic, tmp_path / "h")
    edit_json(tmp_path / "h", lambda data: data["face_units"].reverse())
    with pytest.raises(
        FileFormatError, match=r"face_units: .*, found 52 of them, or another order"
    ):
        load_head(tmp_path / "h")


def test_pickled_arrays_are_never_read(saved: Path) -> None:
    with np.load(saved / "geometry.npz") as file:
        arrays = dict(file)
    arrays["part"] = np.array([{"a": 1}], dtype=object)
    np.savez(saved / "geometry.npz", **arrays)
    with pytest.raises(
        FileFormatError, match=r"geometry\.npz: part: expected whole numbers, found object"
    ):
        load_head(saved)


def test_the_documents_own_reader_works(saved: Path, small_head: Head) -> None:
    """docs/reference/head-folder.md shows how to read the folder with numpy; it must be true."""
    text = (Path(__file__).parents[3] / "docs" / "reference" / "head-folder.md").read_text("utf-8")
    program = text.split("```python\n")[1].split("```")[0]
    program = program.replace('open("HEAD/head.json", encoding="utf-8")', "opened")
    program = program.replace("HEAD", saved.as_posix())
    with (saved / "head.json").open(encoding="utf-8") as opened:
        found: dict[str, Any] = {"opened": opened}
        exec(program, found)
    found["arrays"].close()
    vertices = small_head.mesh.vertices + 0.5 * small_head.units[1]
    np.testing.assert_allclose(found["vertices"], vertices, rtol=1e-6, atol=1e-5)
    expected = small_head.views[0].camera.project(vertices)
    np.testing.assert_allclose(found["pixels"], expected, rtol=1e-5)


def test_the_document_shows_every_key(saved: Path) -> None:
    text = (Path(__file__).parents[3] / "docs" / "reference" / "head-folder.md").read_text("utf-8")
    shown = json.loads(text.split("```json\n")[1].split("```")[0])
    written = json.loads((saved / "head.json").read_text("utf-8"))
    assert list(shown) == list(written)
    assert list(shown["units"]) == list(written["units"])
    shown, written = (data["expressions"]["neutral"] for data in (shown, written))
    assert list(shown) == list(written)
    assert list(shown["cameras"][0]) == list(written["cameras"][0])
