from __future__ import annotations

import numpy as np

from mien.reconstruction.dense.quality import REGIONS, RegistrationQuality

NAMES = ["a.png", "b.png", "c.png", "d.png"]


def quality(**changed: np.ndarray) -> RegistrationQuality:
    fine = {
        "shared": np.full(4, 500),
        "outlier_fraction": np.full((4, len(REGIONS)), 0.04),
        "turn_sd": np.radians([0.0, 0.1, 0.1, 0.2]),
        "rms_px": np.full(4, 0.1),
    }
    return RegistrationQuality(**(fine | changed))


def test_nothing_to_say_of_good_photos() -> None:
    assert quality().notes(NAMES) == ()


def test_a_photo_that_shares_too_little() -> None:
    (note,) = quality(shared=np.array([500, 12, 400, 300])).notes(NAMES)
    assert note.startswith("b.png: shares too little skin with the other photos (12 places)")


def test_regions_that_differ_are_named() -> None:
    outlier_fraction = np.full((4, len(REGIONS)), 0.04)
    outlier_fraction[2, 0] = 0.5
    (note,) = quality(outlier_fraction=outlier_fraction).notes(NAMES)
    assert note.startswith("c.png: the mouth differs from the other photos")
    outlier_fraction[2, 1] = 0.5
    (note,) = quality(outlier_fraction=outlier_fraction).notes(NAMES)
    assert note.startswith("c.png: the mouth and the eyes differ from the other photos")


def test_a_region_that_moves_in_all_photos_is_nobodys_fault() -> None:
    assert quality(outlier_fraction=np.full((4, len(REGIONS)), 0.4)).notes(NAMES) == ()
    unknown = np.full((4, len(REGIONS)), np.nan)
    unknown[0] = 0.9
    assert quality(outlier_fraction=unknown).notes(NAMES) == ()


def test_an_angle_that_is_not_known() -> None:
    (note,) = quality(turn_sd=np.radians([0.0, 4.2, 0.1, 0.1])).notes(NAMES)
    assert "known to 4 degrees only" in note
