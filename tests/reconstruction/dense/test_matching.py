from __future__ import annotations

import numpy as np
import pytest

from marbled import GENERIC, Person, at
from mien.reconstruction.dense.crops import crop_view, visible_mesh
from mien.reconstruction.dense.matching import Match, SurfaceCrop, check_match, match_crops

CAMERAS = (at(-12, 3), at(14, -2))


@pytest.fixture(scope="module")
def sights(ann: Person) -> tuple[SurfaceCrop, SurfaceCrop]:
    return sights_of(ann, gain=1.0, bias=0.0)


def sights_of(ann: Person, *, gain: float, bias: float) -> tuple[SurfaceCrop, SurfaceCrop]:
    """Both photos; the second one's exposure is changed."""
    mesh = visible_mesh(GENERIC, ann.vertices)
    found = []
    for k, camera in enumerate(CAMERAS):
        crop = crop_view(ann.seen_by(camera), camera, mesh, 0.9)
        assert crop is not None
        if k:
            crop.grey[:] = gain * crop.grey + bias
        found.append(SurfaceCrop.of(crop, mesh, mesh.vertex_normals()))
    return found[0], found[1]


def matched(a: SurfaceCrop, b: SurfaceCrop) -> tuple[Match, np.ndarray]:
    there, back = match_crops(a, b), match_crops(b, a)
    assert there is not None
    assert back is not None
    return check_match(there, back)


def off_px(a: SurfaceCrop, b: SurfaceCrop, match: Match) -> np.ndarray:
    """From where the surface behind a's pixel is in b, where the match is valid."""
    points = b.crop.camera.project(a.points[match.valid].reshape(-1, 3))
    return np.linalg.norm(match.points[match.valid] - points, axis=-1)


def test_matches_hit_the_same_point_of_the_surface(sights: tuple[SurfaceCrop, SurfaceCrop]) -> None:
    match, miss = matched(*sights)
    off = off_px(*sights, match)
    assert match.valid.sum() > 0.3 * sights[0].usable.sum()
    assert np.median(off) < 0.15
    assert np.quantile(off, 0.95) < 0.6
    assert np.median(miss[match.valid]) < 0.15


def test_exposure_does_not_matter(ann: Person, sights: tuple[SurfaceCrop, SurfaceCrop]) -> None:
    changed = sights_of(ann, gain=0.7, bias=12.0)
    match, _ = matched(*changed)
    assert np.median(off_px(*changed, match)) < 0.2
    assert match.valid.sum() > 0.9 * matched(*sights)[0].valid.sum()


def test_nothing_is_claimed_beside_the_head_or_where_it_turns_away(
    sights: tuple[SurfaceCrop, SurfaceCrop],
) -> None:
    match, _ = matched(*sights)
    assert not match.valid[~sights[0].usable].any()


def test_another_persons_skin_is_not_matched(
    ann: Person, sights: tuple[SurfaceCrop, SurfaceCrop]
) -> None:
    other = sights_of(Person(ann.vertices, ann.skin + 1), gain=1.0, bias=0.0)
    match, _ = matched(sights[0], other[1])
    assert match.valid.sum() < 0.12 * matched(*sights)[0].valid.sum()
