from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.render.shade import rasterize_mesh
from mien.rig.contacts.lids import Lids, resolve_lids
from mien.rig.gaze import SIDES
from mien.rig.skin_paths import shortest_path, skin_edges

if TYPE_CHECKING:
    from conftest import Rigged

GENERIC = load_generic_head()
BLINK = {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}
LID_UNITS = [name for name in GENERIC.unit_names if name.startswith(("eye", "cheekSquint"))]


def eyeball_pixels(vertices: np.ndarray, side: str, yaw: float, pitch: float) -> int:
    """How many pixels of this eye a camera before it sees, 10 px a mm."""
    a, b = np.radians([yaw, pitch])
    about_y = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    rotation = np.diag([1.0, -1, -1]) @ about_x @ about_y
    target = vertices[list(GENERIC.polylines[f"{side}_lower_eyelid"])].mean(axis=0)
    camera = Camera(400, 250, 7000.0, rotation, np.array([0, 0, 700]) - rotation @ target)
    mesh = GENERIC.mesh.with_vertices(vertices)
    ball = f"{side}_eyeball"
    shown = mesh.submesh(mesh.triangles_of("skin", ball))
    ids = rasterize_mesh(shown, camera).triangle_ids
    return int((shown.part[ids[ids >= 0]] == mesh.part_names.index(ball)).sum())


def test_the_margin_is_one_closed_path_of_28_edges() -> None:
    edges = skin_edges(GENERIC, GENERIC.mesh.vertices)
    upper, lower = (
        shortest_path(edges, GENERIC.polylines[f"left_{which}_eyelid"])
        for which in ("upper", "lower")
    )
    assert (upper[0], upper[-1]) == (lower[0], lower[-1])
    assert len(set(upper) | set(lower)) == len(upper) + len(lower) - 2 == 28
    for path in (upper, lower):
        assert (np.asarray(edges[path[:-1], path[1:]]) > 0).all()


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("yaw", [-30, 0, 30])
@pytest.mark.parametrize("pitch", [-20, 0, 20])
def test_closed_lids_show_no_eye(rigged: Rigged, side: str, yaw: int, pitch: int) -> None:
    assert eyeball_pixels(rigged.posed(**BLINK), side, yaw, pitch) == 0


def test_open_lids_show_the_eye(rigged: Rigged) -> None:
    assert eyeball_pixels(rigged.neutral, "left", 0, 0) > 1000


@pytest.mark.parametrize("name", LID_UNITS)
@pytest.mark.parametrize("weight", [0.5, 1.0])
def test_no_lid_enters_the_eyeball(rigged: Rigged, name: str, weight: float) -> None:
    posed = rigged.posed(**{name: weight})
    for lids in rigged.deformer.contacts.lids:
        depth = (lids.min_radius - lids.spherical(posed)[:, 2]) * lids.eyeball.radius
        assert depth.max() < 0.15


@pytest.mark.parametrize(
    "others",
    [("eyeLookDown",), ("eyeSquint", "cheekSquint"), ("eyeSquint", "eyeLookUp"), ("mouthSmile",)],
)
def test_in_mixtures_lids_meet_and_do_not_pass(rigged: Rigged, others: tuple[str, ...]) -> None:
    weights = BLINK | {f"{name}{side}": 1.0 for name in others for side in ("Left", "Right")}
    living = rigged.living(**weights)
    for side, lids in zip(SIDES, rigged.deformer.contacts.lids, strict=True):
        places = lids.spherical(living)
        overlap = lids.overlap(places) * lids.eyeball.radius
        assert (places[:, 2] > lids.min_radius - 1e-5).all()
        assert overlap.max() < 1.0
        assert eyeball_pixels(living, side, 0, 0) == 0


def test_a_half_blink_leaves_half_an_opening(rigged: Rigged) -> None:
    lids = rigged.deformer.contacts.lids[0]
    opening = [
        -lids.overlap(lids.spherical(rigged.living(eyeBlinkLeft=weight))).min()
        for weight in (0.0, 0.5, 1.0)
    ]
    assert 0.35 < opening[1] / opening[0] < 0.65
    assert opening[2] <= 1e-6


def test_lids_without_contact_are_left_alone(rigged: Rigged) -> None:
    for lids in rigged.deformer.contacts.lids:
        assert resolve_lids(lids, rigged.neutral) is None


def resolved_by_rounds(lids: Lids, vertices: np.ndarray) -> np.ndarray:
    """(L, 3) mm: either lid gives way by half, over and over; then out of the eyeball."""
    places = before = lids.spherical(vertices)
    pressed = np.zeros(lids.upper)
    for _ in range(4):
        too_far = np.maximum(lids.overlap(places) - lids.full_overlap, 0)
        back = lids.spread(places, too_far) / 2
        places = places + np.outer(np.where(lids.on_upper, back, -back), [0, 1, 0])
        pressed += too_far
    upper, lower = lids.edges(places)
    wanted = np.interp(upper[:, 0], np.maximum.accumulate(lower[:, 0]), lower[:, 2])
    firmly = np.minimum(pressed * lids.eyeball.radius / 0.5, 1)
    off = (wanted + lids.full_overlap * 0.15 / 0.35 - upper[:, 2]) * firmly
    places[:, 2] += lids.spread(places, off) * lids.on_upper
    places[:, 2] = np.maximum(places[:, 2], lids.min_radius)
    return lids.from_spherical(places) - lids.from_spherical(before)


@pytest.mark.parametrize(("blink", "squint"), [(1.0, 1.0), (0.8, 0.6), (0.4, 0.0), (1.4, 0.0)])
def test_each_lid_moves_by_half(rigged: Rigged, blink: float, squint: float) -> None:
    weights = {"eyeBlinkLeft": blink, "eyeBlinkRight": blink, "eyeSquintLeft": squint}
    posed = rigged.posed(**weights, eyeLookDownLeft=0.7, cheekSquintRight=0.5)
    for lids in rigged.deformer.contacts.lids:
        moved = resolve_lids(lids, posed)
        assert blink < 1 or moved is not None
        moved = np.zeros((len(lids.vertices), 3)) if moved is None else moved
        np.testing.assert_allclose(moved, resolved_by_rounds(lids, posed), atol=1e-4)
        again = resolve_lids(lids, posed + np.array([3.0, -2.0, 5.0]))
        np.testing.assert_allclose(0 if again is None else again, moved, atol=1e-9)


def test_spherical_coordinates_round_trip(rigged: Rigged) -> None:
    lids = Lids.of(GENERIC, rigged.neutral, "left")
    again = lids.from_spherical(lids.spherical(rigged.neutral))
    np.testing.assert_allclose(again, rigged.neutral[lids.vertices], atol=1e-9)


def test_corrections_leave_cheek_and_brow_alone(rigged: Rigged) -> None:
    change = np.abs(rigged.units - rigged.transferred)[GENERIC.unit_names.index("eyeBlinkLeft")]
    for name in ("left_nose_wing", "nose_root", "left_mouth_corner", "left_eyebrow_upper.2"):
        assert not change[GENERIC.vertex_of(name)].any()
