"""Points of zhang134 that the usual templates of `.tem` files have, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mien.io.landmarks.pts import IBUG_SHARED

__all__ = ["TEMPLATES", "TemTemplate"]


@dataclass(frozen=True)
class TemTemplate:
    """A template; which one a file has is known by its number of points.

    Attributes:
        origin: who made it.
        shared: number of the point at the same place, by the name in zhang134.
    """

    origin: str
    shared: Mapping[str, int]


def _both_sides(pairs: Mapping[str, tuple[int, int]]) -> dict[str, int]:
    return {
        f"{side}_{name}": number
        for name, numbers in pairs.items()
        for side, number in zip(("right", "left"), numbers, strict=True)
    }


_FACE_PP_83 = {
    **_both_sides(
        {
            "brow_upper.2": (68, 15),
            "brow_upper.3": (62, 69),
            "eye_inner": (79, 61),
            "eye_outer": (44, 40),
            "upper_eyelid.0": (51, 67),
            "upper_eyelid.2": (56, 38),
            "upper_eyelid.3": (4, 34),
            "lower_eyelid.0": (58, 47),
            "lower_eyelid.1": (11, 17),
            "lower_eyelid.2": (25, 41),
            "pupil": (63, 81),
            "nose_wing.0": (71, 74),
            "mouth_corner": (29, 45),
            "upper_lip_outer.0": (3, 72),
            "upper_lip_outer.2": (0, 42),
            "lower_lip_outer.2": (10, 75),
            "upper_lip_inner.1": (1, 46),
            "lower_lip_inner.1": (52, 9),
        }
    ),
    "nose_tip": 35,
    "nose_base": 37,
    "upper_lip_outer": 26,
    "upper_lip_inner": 82,
    "lower_lip_inner": 14,
    "lower_lip_outer": 12,
    "menton": 6,
}
_FACE_PP_106 = {
    **_both_sides(
        {
            "brow_upper.0": (57, 63),
            "brow_upper.3": (54, 66),
            "brow_lower.0": (58, 62),
            "brow_lower.2": (61, 68),
            "eye_inner": (39, 44),
            "eye_outer": (35, 48),
            "upper_eyelid.0": (38, 45),
            "upper_eyelid.2": (37, 46),
            "upper_eyelid.3": (36, 47),
            "lower_eyelid.0": (40, 51),
            "lower_eyelid.1": (41, 50),
            "lower_eyelid.2": (42, 49),
            "pupil": (0, 1),
            "nose_wing.0": (76, 84),
            "nose_wing.3": (79, 81),
            "mouth_corner": (86, 92),
            "upper_lip_outer.0": (88, 90),
            "upper_lip_outer.2": (87, 91),
            "lower_lip_outer.2": (101, 105),
            "inner_mouth_corner": (93, 97),
            "upper_lip_inner.1": (94, 96),
            "lower_lip_inner.1": (98, 100),
        }
    ),
    "nose_root": 71,
    "nose_bridge": 73,
    "nose_tip": 74,
    "nose_base": 80,
    "upper_lip_outer": 89,
    "upper_lip_inner": 95,
    "lower_lip_inner": 99,
    "lower_lip_outer": 103,
    "menton": 18,
}
_FACE_RESEARCH_LAB = {
    **_both_sides(
        {
            "eye_inner": (22, 23),
            "eye_outer": (18, 27),
            "lower_eyelid.0": (30, 31),
            "lower_eyelid.1": (29, 32),
            "lower_eyelid.2": (28, 33),
            "pupil": (0, 1),
            "lid_fold.1": (36, 41),
            "nose_wing.1": (62, 67),
            "mouth_corner": (87, 93),
            "upper_lip_outer.0": (89, 91),
        }
    ),
    "nose_base": 55,
    "upper_lip_outer": 90,
    "upper_lip_inner": 96,
    "lower_lip_inner": 101,
    "lower_lip_outer": 106,
    "menton": 129,
}
_DLIB_70 = {
    "right_pupil": 0,
    "left_pupil": 1,
    **{name: 2 + number for number, name in IBUG_SHARED.items()},
}
_DLIB_7 = {
    "left_eye_outer": 2,
    "left_eye_inner": 3,
    "right_eye_outer": 4,
    "right_eye_inner": 5,
    "nose_base": 6,
}
TEMPLATES = {
    7: TemTemplate("dlib's 5 and the middles of the eyes", _DLIB_7),
    70: TemTemplate("pupils and iBUG's 68", _DLIB_70),
    83: TemTemplate("Face++", _FACE_PP_83),
    106: TemTemplate("Face++", _FACE_PP_106),
    189: TemTemplate("Face Research Lab", _FACE_RESEARCH_LAB),
}
"""By the number of points: those that WebMorph finds by itself, and its own, marked by hand.

Points of these and the detector agree, on the mean of a pair over four to six photos, to 3.4 % of
the distance between the outer corners of the eyes; the menton of Face++ to 5 %. Points of similar
names that lie 4 to 10 % apart are left out: the middle of brows, rims of nostrils, the jaw.

Of 7 and 70 points are those of webmorphR.dlib, which puts two for the eyes before dlib's own: of
70 the means of the lids' points, of 7 those of the eyes' corners, which are no pupils.
Source: https://github.com/debruine/webmorphR.dlib, dlib_auto_delin.R.
"""
