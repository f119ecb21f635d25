from __future__ import annotations

import html
import re

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.camera import head_angles_deg
from mien.head import Expression, FittedView, Head
from mien.reconstruction.fit import FitOptions, fit_views
from mien.reconstruction.result import Mark, NeutralFit, PhotoFit
from mien.render.orbit import orbit_camera
from mien.report import ReportInput, render_report
from people import camera, person, photographed

GENERIC = load_generic_head()
PERSON = person(4)
NAMES = ("front <b>.png", "side & all.png")


@pytest.fixture(scope="module")
def report_input() -> ReportInput:
    views = [
        photographed(PERSON, camera(yaw), name=name, points=list(GENERIC.points))
        for yaw, name in zip((0, 35), NAMES, strict=True)
    ]
    fit = fit_views(views, GENERIC, FitOptions(rounds=1))
    photo = fit.photos[NAMES[0]]
    slipped = Mark("chin", np.array([5.0, 7.0]), np.array([30.0, 40.0]), True, "99 times off")
    marks = tuple(slipped if mark.name == "chin" else mark for mark in photo.marks)
    fit = NeutralFit(
        fit.vertices,
        {**fit.photos, NAMES[0]: PhotoFit(photo.camera, marks)},
        fit.left_out,
        uncertainty_mm=fit.uncertainty_mm,
        verdict=fit.verdict,
        registered=fit.registered,
    )
    head = Head(
        subject="Zoë <script>",
        mesh=GENERIC.mesh.with_vertices(fit.vertices),
        expressions={
            "neutral": Expression(
                fit.vertices,
                tuple(
                    FittedView(name, item.camera, item.rms_px, len(item.inliers))
                    for name, item in fit.photos.items()
                ),
            )
        },
        uncertainty_mm=fit.uncertainty_mm,
        textures={"atlas": np.full((64, 64, 3), 150, np.uint8)},
    )
    photos = {view.photo.name: view.photo.pixels for view in views}
    notes = ("one of <i>these</i> is odd",)
    return ReportInput(head, photos, {"neutral": fit}, np.ones((64, 64)), notes, "turntable.mp4")


@pytest.fixture(scope="module")
def page(report_input: ReportInput) -> str:
    return render_report(report_input)


def cells(row: str) -> list[str]:
    return [html.unescape(text).strip() for text in re.findall(r"<t[dh]>(.*?)</t[dh]>", row, re.S)]


def test_every_photo_has_its_line_and_its_picture(page: str, report_input: ReportInput) -> None:
    rows = [cells(row) for row in re.findall(r"<tr.*?</tr>", page, re.S)]
    for name, item in report_input.fits["neutral"].photos.items():
        (line,) = [row for row in rows if row[0] == name]
        assert line[1] == f"1000 {chr(215)} 1300"
        assert line[2] == f"{item.camera.focal_px:.0f}"
        assert line[-2:] == [str(len(item.inliers)), f"{item.rms_px:.2f}"]
        assert f'alt="{html.escape(name)} with the mesh"' in page


def test_every_mark_has_its_line(page: str, report_input: ReportInput) -> None:
    for text, item in zip(
        re.findall(r"<details>.*?</details>", page, re.S),
        report_input.fits["neutral"].photos.values(),
        strict=True,
    ):
        rows = [cells(row) for row in re.findall(r"<tr.*?</tr>", text, re.S)][1:]
        assert {row[0] for row in rows} == {mark.name for mark in item.marks}
        shown = {row[0]: row[3:] for row in rows}
        for mark in item.marks:
            assert shown[mark.name] == [f"{mark.distance_px:.2f}", mark.rejection or "by hand"]
        lengths = [float(row[3]) for row in rows]
        assert lengths == sorted(lengths, reverse=True)


def test_distrusted_marks_stand_out(page: str) -> None:
    (row,) = re.findall(r'<tr class="distrusted">.*?</tr>', page, re.S)
    assert cells(row) == ["chin", "5.0", "7.0", "50.00", "99 times off"]
    assert re.search(r"13 marks,\s+1 distrusted", page)


def test_names_and_notes_are_escaped(page: str) -> None:
    assert "Zoë &lt;script&gt;: report of the build" in page
    assert "one of &lt;i&gt;these&lt;/i&gt; is odd" in page
    assert "<script" not in page
    assert "<b>" not in page
    assert "<i>" not in page


def test_the_page_stands_alone(page: str) -> None:
    text = re.sub(r"data:[^\"]*", "", page)
    assert "http" not in text
    assert "url(" not in text
    assert "@import" not in text
    targets = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert [target for target in targets if not target.startswith("data:image/jpeg;base64,")] == [
        "turntable.mp4"
    ]
    # Six looks from around, four of the coverage, and every photo.
    assert len(targets) == 1 + 6 + 4 + 4 + 2


def test_a_page_without_a_turntable(report_input: ReportInput) -> None:
    data = ReportInput(
        report_input.head, report_input.photos, report_input.fits, report_input.coverage
    )
    assert "<video" not in render_report(data)


def test_angles_of_a_camera_that_goes_around() -> None:
    """A camera on the subject's right sees the head turned to its own left, and so on."""
    yaw, pitch, roll = head_angles_deg(camera(0))
    np.testing.assert_allclose([yaw, pitch, roll], 0, atol=1e-9)
    for offset, expected in (([-300, 0, 700], (1, 0)), ([0, 300, 700], (0, 1))):
        forward = -np.array(offset) / np.linalg.norm(offset)
        right = np.cross(forward, [0, 1, 0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        seen = camera(0)
        seen = type(seen)(1000, 1000, 2000.0, rotation, -rotation @ np.array(offset, float))
        np.testing.assert_allclose(seen.center, offset, atol=1e-9)
        angle = np.degrees(np.arctan2(300, 700))
        np.testing.assert_allclose(head_angles_deg(seen)[:2], np.array(expected) * angle, atol=1e-9)


def test_roll_is_towards_the_right_shoulder() -> None:
    """The top of the head leans to the subject's right, the left of the picture."""
    angle = np.radians(20)
    c, s = np.cos(angle), np.sin(angle)
    lean = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    seen = camera(0)
    seen = type(seen)(*(1000, 1000, 2000.0), lean @ seen.R_cam_head, seen.t_cam_head)
    top, origin = seen.to_camera(np.array([[0.0, 100, 0], [0, 0, 0]]))
    assert top[0] < origin[0]
    np.testing.assert_allclose(head_angles_deg(seen), (0, 0, 20), atol=1e-9)


@pytest.mark.parametrize("angles", [(30, 0, 0), (40, 25, -15), (-100, 5, 3), (0, -60, 20)])
def test_angles_are_those_that_render_takes(angles: tuple[float, float, float]) -> None:
    yaw, pitch, roll = np.radians(angles)
    seen = orbit_camera(-yaw, pitch, roll, width=100, height=100, vertices=GENERIC.mesh.vertices)
    np.testing.assert_allclose(head_angles_deg(seen), angles, atol=1e-9)
