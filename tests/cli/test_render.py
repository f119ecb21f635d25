"""`mien render`: the pictures are looked at, not only their sizes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.mediapipe_face import yaw_pitch
from mien.capture.images.photos import load_photo
from mien.io.head.head_folder import load_head
from terminal import Built, Mien

GREY = ("--background", "#484a54")


def pixels(path: Path) -> Array:
    with Image.open(path) as image:
        return np.asarray(image)


def face_hull(built: Built, photo: str) -> Array:
    """(H, W) bool: the photo's pixels inside the hull of eyes, brows, nose, mouth and jaw."""
    import cv2

    head, generic = load_head(built.folder), load_generic_head()
    camera = head.view(photo).camera
    names = ("eyebrow_upper", "lower_eyelid", "nose", "lip", "jaw")
    lines = [line for name, line in generic.polylines.items() if any(n in name for n in names)]
    places = camera.project(head.mesh.vertices[np.concatenate(lines)])
    hull = cv2.convexHull(np.rint(places).astype(np.int32))
    mask = np.zeros((camera.height, camera.width), np.uint8)
    cv2.fillConvexPoly(mask, hull, 1)
    return mask.astype(bool)


@pytest.mark.parametrize("photo", ["left.png", "right.png"])
def test_a_photos_camera_gives_back_the_photo(
    photo: str, built: Built, mien: Mien, tmp_path: Path
) -> None:
    """Inside the face, through a texture of 256 texels a side: 25.5 and 24.2 dB measured."""
    out = tmp_path / "view.png"
    assert mien("render", built.folder, "-o", out, "--camera", photo, "--size", "10x10").status == 0
    picture, seen = pixels(out), pixels(built.source / photo)
    assert picture.shape == (500, 375, 4)
    inside = face_hull(built, photo)
    assert (picture[inside, 3] == 255).mean() > 0.98
    error = picture[inside, :3].astype(float) - seen[inside]
    psnr = 20 * np.log10(255 / np.sqrt((error**2).mean()))
    assert psnr > 22


def test_size_and_alpha(built: Built, mien: Mien, tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    ran = mien("render", built.folder, "-o", out, "--size", "120x150", "--json")
    assert ran.json == {"output": str(out), "notes": []}
    picture = pixels(out)
    assert picture.shape == (150, 120, 4)
    assert (picture[0, :, 3] == 0).all()
    assert picture[75, 60, 3] == 255


def test_background(built: Built, mien: Mien, tmp_path: Path) -> None:
    """With one, a picture needs no alpha and may be a JPEG; without, it may not."""
    out = tmp_path / "a.png"
    assert mien("render", built.folder, "-o", out, "--background", "#204060").out == f"{out}\n"
    assert pixels(out)[0, 0].tolist() == [0x20, 0x40, 0x60, 255]
    assert (pixels(out)[..., 3] == 255).all()
    jpeg = tmp_path / "a.jpg"
    assert mien("render", built.folder, "-o", jpeg, *GREY).status == 0
    assert mien("render", built.folder, "-o", tmp_path / "b.jpg").error == (
        f"{tmp_path / 'b.jpg'}: expected a .png for a picture with transparency, got .jpg"
    )


@pytest.fixture(scope="module")
def detector() -> Iterator[LandmarkDetector]:
    with LandmarkDetector() as detector:
        yield detector


@pytest.mark.parametrize(("yaw", "pitch"), [(0, 0), (30, 0), (-30, 0), (0, 15), (0, -15)])
def test_the_head_turns_as_the_conventions_say(
    yaw: float, pitch: float, built: Built, mien: Mien, tmp_path: Path, detector: LandmarkDetector
) -> None:
    """The face detector knows nothing of the renderer; it is good to some 10 degrees."""
    out = tmp_path / "a.png"
    mien("render", built.folder, "-o", out, "--yaw", yaw, "--pitch", pitch, *GREY)
    seen = np.degrees(yaw_pitch(detector.detect(load_photo(out)).R_cam_head))
    np.testing.assert_allclose(seen, [yaw, pitch], atol=12)


def test_roll_tips_the_head_to_its_right_shoulder(
    built: Built, mien: Mien, tmp_path: Path, detector: LandmarkDetector
) -> None:
    out = tmp_path / "a.png"
    mien("render", built.folder, "-o", out, "--roll", 20, *GREY)
    left_iris, right_iris = detector.detect(load_photo(out)).points[[473, 468]]
    # The right eye, left in the picture, comes to lie lower.
    across, down = right_iris - left_iris
    assert across < 0
    assert np.degrees(np.arctan2(down, -across)) == pytest.approx(20, abs=4)


def test_a_unit_moves_its_part_of_the_face_alone(built: Built, mien: Mien, tmp_path: Path) -> None:
    size = ("--size", "240x300")
    mien("render", built.folder, "-o", tmp_path / "a.png", *size)
    mien("render", built.folder, "-o", tmp_path / "b.png", *size, "--unit", "jawOpen=0.5")
    before, after = (pixels(tmp_path / name).astype(int) for name in ("a.png", "b.png"))
    rows = np.flatnonzero(np.abs(after - before).max(axis=(1, 2)) > 40)
    head = np.flatnonzero(before[..., 3].any(axis=1))
    assert (rows > head.mean()).mean() > 0.95, "next to nothing above the mouth: the jaw's hinge"
    assert len(rows) > 20


SMALL = ("--size", "120x150")


def rendered(mien: Mien, head: Path, out: Path, *options: object) -> Array:
    assert mien("render", head, "-o", out, *options).status == 0
    return pixels(out).astype(int)


def test_an_expression_shows_its_texture(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    """Halfway between the two: each pixel's colour is mixed, where the shape hardly moves."""
    place = (50, 60, slice(3))
    pictures = [
        rendered(mien, expressive, tmp_path / f"{w}.png", *SMALL, "--expression", f"joy={w}")
        for w in (0, 0.5, 1)
    ]
    rest, half, joy = (picture[place] for picture in pictures)
    np.testing.assert_allclose(half, (rest + joy) / 2, atol=2)
    assert joy[0] > 1.5 * joy[1:].max()


def test_a_region_alone_changes(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    rest = rendered(mien, expressive, tmp_path / "a.png", *SMALL)
    mouth = rendered(mien, expressive, tmp_path / "b.png", *SMALL, "--region", "mouth:joy=1")
    rows = np.flatnonzero((rest != mouth).any(axis=(1, 2)))
    head = np.flatnonzero(rest[..., 3].any(axis=1))
    assert len(rows) > 10
    assert rows.min() > head[len(head) // 3], "below the eyes"


def test_the_eyes_look_to_their_own_left(built: Built, mien: Mien, tmp_path: Path) -> None:
    """The dark of an iris moves to the picture's right."""
    where = []
    for yaw in (-20, 20):
        size = ("--size", "600x750")
        shown = rendered(mien, built.folder, tmp_path / "a.png", *size, "--gaze", f"{yaw},0")
        where.append(shown[..., :3].sum(axis=2))
    changed = np.abs(where[0] - where[1]) > 60
    assert changed.sum() > 20
    columns = np.broadcast_to(np.arange(600), changed.shape)
    to_right, to_left = (
        columns[changed & mask] for mask in (where[1] < where[0], where[1] > where[0])
    )
    middle = 300
    for side in (lambda x: x < middle, lambda x: x >= middle):
        assert to_right[side(to_right)].mean() > to_left[side(to_left)].mean()


def test_a_photo_of_an_expression_shows_it(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    camera = ("--camera", "joy/left.png")
    shown = rendered(mien, expressive, tmp_path / "a.png", *camera)
    told = rendered(mien, expressive, tmp_path / "b.png", *camera, "--expression", "joy=1")
    np.testing.assert_array_equal(shown, told)
    other = rendered(mien, expressive, tmp_path / "c.png", *camera, "--expression", "neutral=1")
    assert (other != shown).any()


def test_past_what_was_photographed_is_noted(expressive: Path, mien: Mien, tmp_path: Path) -> None:
    out = tmp_path / "a.png"
    options = ("-o", out, *SMALL, "--expression", "joy=1.25", "--region", "mouth:anger=0.5")
    note = "face: past what was photographed (weights outside 0 to 1): neutral -0.25, joy 1.25"
    ran = mien("render", expressive, *options)
    assert (ran.status, ran.out, ran.err) == (0, f"{out}\n", f"note: {note}\n")
    assert mien("render", expressive, *options, "--json").json["notes"] == [note]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--expression", "joy=1.6"], "weight of joy: expected -0.5 to 1.5, got 1.6"),
        (["--region", "eyes:joy=-0.51"], "weight of joy: expected -0.5 to 1.5, got -0.51"),
        (
            ["--expression", "joy=0.9", "--expression", "anger=0.9"],
            "weight of neutral: expected -0.5 to 1.5, got -0.8",
        ),
        (
            ["--expression", "joi=1"],
            "expression: expected one of the head's, such as joy, got joi",
        ),
        (
            ["--expression", "joy=0.5", "--expression", "neutral=0.6"],
            "weights: expected weights that sum to 1, got the sum 1.1",
        ),
    ],
)
def test_weights_out_of_range(
    options: list[str], message: str, expressive: Path, mien: Mien, tmp_path: Path
) -> None:
    error = mien("render", expressive, "-o", tmp_path / "a.png", *options).error
    assert error == message
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--unit", "jawOpn=0.5"], "unit: expected one of the head's, such as jawOpen, "),
        (["--unit", "qqqq=0.5"], "unit: expected one of the head's, such as browDownLeft, "),
        (["--expression", "joy=0.5"], "expression: expected one of the head's, such as neutral, "),
        (["--expression", "joy"], "--expression: expected NAME=AMOUNT, as joy=0.6, got joy"),
        (["--region", "mouht:joy=1"], "region: expected one of the head's, such as mouth"),
        (["--region", "mouth=1"], "--region: expected REGION:NAME=AMOUNT, as mouth:anger=0.4"),
        (["--gaze", "10"], "--gaze: expected YAW,PITCH in degrees, as 10,-5, got 10"),
        (["--unit", "jawOpen"], "--unit: expected NAME=AMOUNT, as jawOpen=0.5, got jawOpen"),
        (
            ["--unit", "jawOpen=wide"],
            "--unit: expected NAME=AMOUNT, as jawOpen=0.5, got jawOpen=wide",
        ),
        (
            ["--unit", "jawOpen=nan"],
            "--unit: expected NAME=AMOUNT, as jawOpen=0.5, got jawOpen=nan",
        ),
        (["--size", "800"], "--size: expected WIDTHxHEIGHT in px, as 800x1000, got 800"),
        (["--size", "0x10"], "--size: expected WIDTHxHEIGHT in px, as 800x1000, got 0x10"),
        (["--size", "99999x99999"], "--size: expected at most 8192 px a side, got 99999x99999"),
        (["--background", "blue"], "--background: expected a colour, as #204060, got blue"),
        (["--background", "#123"], "--background: expected a colour, as #204060, got #123"),
        (
            ["--camera", "me.png"],
            "photo: expected one of the head's photos (left.png, right.png), got me.png",
        ),
        (["--yaw", "left"], "Invalid value for '--yaw'"),
        (["--yaw", "nan"], "--yaw: expected a finite number, got nan"),
        (["--smile"], "No such option: --smile"),
    ],
)
def test_bad_options(
    options: list[str], message: str, built: Built, mien: Mien, tmp_path: Path
) -> None:
    error = mien("render", built.folder, "-o", tmp_path / "a.png", *options).error
    assert error.startswith(message)
    assert not (tmp_path / "a.png").exists()


def test_an_unknown_suffix(built: Built, mien: Mien, tmp_path: Path) -> None:
    error = mien("render", built.folder, "-o", tmp_path / "a.bmp").error
    assert (
        error == f"{tmp_path / 'a.bmp'}: expected a name that ends in .png, .jpg, .jpeg, got .bmp"
    )


def test_a_failed_picture_leaves_the_old_one(
    built: Built, mien: Mien, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "a.png"
    out.write_bytes(b"old")

    def fail(*arguments: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fail)
    assert mien("render", built.folder, "-o", out).error.startswith(f"{out}: expected a place")
    assert out.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
