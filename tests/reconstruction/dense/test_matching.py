from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC, Person, at
from mien.reconstruction.dense.crops import crop_view, visible_mesh
from mien.reconstruction.dense.matching import Match, Sight, check_match, match_sights

CAMERAS = (at(-12, 3), at(14, -2))


@pytest.fixture(scope="module")
def sights(ann: Person) -> tuple[Sight, Sight]:
    return sights_of(ann, gain=1.0, bias=0.0)


def sights_of(ann: Person, *, gain: float, bias: float) -> tuple[Sight, Sight]:
    """Both photos; the second one's exposure is changed."""
    mesh = visible_mesh(GENERIC, ann.vertices)
    found = []
    for k, camera in enumerate(CAMERAS):
        crop = crop_view(ann.seen_by(camera), camera, mesh, 0.9)
        assert crop is not None
        if k:
            crop.grey[:] = gain * crop.grey + bias
        found.append(Sight.of(crop, mesh, mesh.vertex_normals()))
    return found[0], found[1]


def matched(a: Sight, b: Sight) -> tuple[Match, np.ndarray]:
    there, back = match_sights(a, b), match_sights(b, a)
    assert there is not None
    assert back is not None
    return check_match(there, back)


def off_px(a: Sight, b: Sight, match: Match) -> np.ndarray:
    """From where the surface behind a's pixel is in b, where the match is good."""
    places = b.crop.camera.project(a.points[match.good].reshape(-1, 3))
    return np.linalg.norm(match.places[match.good] - places, axis=-1)


def test_matches_hit_the_same_point_of_the_surface(sights: tuple[Sight, Sight]) -> None:
    match, miss = matched(*sights)
    off = off_px(*sights, match)
    assert match.good.sum() > 0.3 * sights[0].usable.sum()
    assert np.median(off) < 0.15
    assert np.quantile(off, 0.95) < 0.6
    assert np.median(miss[match.good]) < 0.15


def test_exposure_does_not_matter(ann: Person, sights: tuple[Sight, Sight]) -> None:
    changed = sights_of(ann, gain=0.7, bias=12.0)
    match, _ = matched(*changed)
    assert np.median(off_px(*changed, match)) < 0.2
    assert match.good.sum() > 0.9 * matched(*sights)[0].good.sum()


def test_nothing_is_claimed_beside_the_head_or_where_it_turns_away(
    sights: tuple[Sight, Sight],
) -> None:
    match, _ = matched(*sights)
    assert not match.good[~sights[0].usable].any()


def test_another_persons_skin_is_not_matched(ann: Person, sights: tuple[Sight, Sight]) -> None:
    other = sights_of(Person(ann.vertices, ann.skin + 1), gain=1.0, bias=0.0)
    match, _ = matched(sights[0], other[1])
    assert match.good.sum() < 0.12 * matched(*sights)[0].good.sum()
