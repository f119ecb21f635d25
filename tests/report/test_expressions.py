from __future__ import annotations

import base64
import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.head import Expression, FittedView, Head
from mien.render.picture import HeadRenderer
from mien.report import ReportInput, render_report
from mien.report.expressions import MIXTURES, expression_psnr, expression_rows
from mien.rig.state import FaceState
from people import camera

GENERIC = load_generic_head()
VERTICES = GENERIC.mesh.vertices
GAINS = np.array([1.25, 1.0, 0.8])
FRONT, SIDE = camera(0).resized(0.25), camera(40).resized(0.25)


def colours(red: int) -> Array:
    return np.full((8, 8, 3), (red, 120, 160), np.uint8)


@pytest.fixture(scope="module")
def head() -> Head:
    """Joy opens the jaw; it was photographed from the front and, first, from the side."""
    jaw = GENERIC.unit_offsets[GENERIC.unit_names.index("jawOpen")]
    views = (FittedView("joy/side.png", SIDE, 1.0, 13), FittedView("joy/a.png", FRONT, 1.0, 13))
    return Head(
        subject="nobody",
        mesh=GENERIC.mesh,
        expressions={
            "neutral": Expression(VERTICES, (FittedView("a.png", FRONT, 1.0, 13),)),
            "joy": Expression(VERTICES + 0.4 * jaw, views, "joy"),
        },
        uncertainty_mm=np.ones(len(VERTICES)),
        unit_names=GENERIC.unit_names,
        unit_offsets=GENERIC.unit_offsets,
        textures={"atlas": colours(80), "joy": colours(200)},
    )


@pytest.fixture(scope="module")
def photos(head: Head) -> dict[str, Array]:
    """What the cameras saw, exactly."""
    renderer = HeadRenderer(head)
    return {
        view.photo: renderer.draw(
            FaceState({"face": {name: 1.0}}), view.camera, background=(9, 9, 9)
        )[..., :3]
        for name, expression in head.expressions.items()
        for view in expression.views
    }


def decoded(uri: str) -> Array:
    with Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))) as image:
        return np.asarray(image).astype(int)


def test_every_expression_is_beside_its_most_frontal_photo(
    head: Head, photos: dict[str, Array]
) -> None:
    told: list[int] = []
    neutral, joy = expression_rows(head, photos, told.append)
    assert told == [1, 2]
    assert [picture["caption"] for picture in neutral["pictures"]] == ["a.png", "mien"]
    captions = [picture["caption"] for picture in joy["pictures"]]
    assert captions == ["joy/a.png", "mien", *MIXTURES]
    sizes = {decoded(picture["source"]).shape for picture in joy["pictures"]}
    assert len(sizes) == 1, "so that they can be compared"


def test_what_is_drawn_exactly_has_hardly_any_error(head: Head, photos: dict[str, Array]) -> None:
    for row in expression_rows(head, photos):
        assert row["psnr"] > 60
    changed = {name: photo ^ 16 for name, photo in photos.items()}
    for row in expression_rows(head, changed):
        assert row["psnr"] == pytest.approx(20 * np.log10(255 / 16), abs=0.01)


def test_only_the_face_counts(head: Head, photos: dict[str, Array]) -> None:
    (view,) = head.expressions["neutral"].views
    photo = np.array(photos["a.png"])
    top = FRONT.project(VERTICES[[GENERIC.vertex_of("hairline.4")]])[0, 1]
    photo[: int(top) - 10] = 255
    psnr, _ = expression_psnr(HeadRenderer(head), "neutral", view, photo)
    assert psnr > 60


def test_a_photos_own_exposure_is_undone(head: Head, photos: dict[str, Array]) -> None:
    """The texture holds the photo's colours times the gains."""
    (view,) = head.expressions["neutral"].views
    photo = np.rint(photos["a.png"] / GAINS).astype(np.uint8)
    psnr, _ = expression_psnr(HeadRenderer(head), "neutral", replace(view, gains=GAINS), photo)
    assert psnr > 55
    psnr, _ = expression_psnr(HeadRenderer(head), "neutral", view, photo)
    assert psnr < 35


def test_mixtures_change_their_own_region(head: Head, photos: dict[str, Array]) -> None:
    joy = expression_rows(head, photos)[1]
    pictures = {item["caption"]: decoded(item["source"]) for item in joy["pictures"]}
    whole, height = pictures["mien"][..., 0] > 170, len(pictures["mien"])

    def reddened(name: str) -> Array:
        rows = np.flatnonzero((pictures[name][..., 0] > 170).sum(axis=1) > 3)
        return rows / height

    assert whole.mean() > 0.2
    assert (pictures["half of it"][..., 0] > 170).mean() < 0.02
    mouth, eyes, forehead = (
        reddened(name) for name in ("in the mouth", "around the eyes", "in the forehead")
    )
    assert np.median(forehead) < np.median(eyes) < np.median(mouth)


def test_a_head_of_neutral_alone_has_nothing_of_it(head: Head, photos: dict[str, Array]) -> None:
    alone = replace(head, expressions={"neutral": head.expressions["neutral"]})
    assert expression_rows(alone, photos) == []
    told: list[tuple[int, int]] = []
    page = render_report(
        ReportInput(alone, photos, {}, np.ones((8, 8))), progress=lambda *step: told.append(step)
    )
    assert "<h2>Expressions</h2>" not in page
    assert told == [(0, 1), (1, 1)]


def test_the_page_shows_them(head: Head, photos: dict[str, Array]) -> None:
    told: list[tuple[int, int]] = []
    page = render_report(
        ReportInput(head, photos, {}, np.ones((8, 8))), progress=lambda *step: told.append(step)
    )
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert "<h2>Expressions</h2>" in page
    for caption in ("a.png", "mien", *MIXTURES):
        assert f'alt="joy: {caption}"' in page or f'alt="joy: joy/{caption}"' in page


def test_an_expression_without_photos_is_left_out(head: Head, photos: dict[str, Array]) -> None:
    joy = replace(head.expressions["joy"], views=())
    made = replace(head, expressions={**head.expressions, "joy": joy})
    assert [row["name"] for row in expression_rows(made, photos)] == ["neutral"]
