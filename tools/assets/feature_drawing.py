"""The feature points, lines and sets of zhang134 as drawn by hand, on one side."""

from __future__ import annotations

Mix = dict[int, float]

# By name, from the midline outwards or from top to bottom: landmarks, or equal mixes of two.
RIGHT: dict[str, list[int | tuple[int, int] | Mix]] = {
    "brow_upper": [107, 66, 105, 63, 70],
    "brow_lower": [55, (65, 52), 53],
    "eye_inner": [133],
    "eye_outer": [33],
    "upper_eyelid": [157, 158, 159, 160],
    "lower_eyelid": [(153, 154), 145, (144, 163)],
    "pupil": [468],
    "lid_fold": [56, (27, 28), 30],
    "eye_bag": [(231, 232), 229],
    "nose_side": [174],
    "nose_wing": [198, 49, 98, 97],
    "nasolabial": [203, (206, 216), 212],
    "cheek": [101, 117, 207],
    "forehead": [(108, 69), 104],
    "hairline": [67, 54],
    "temple": [(162, 127)],
    "jaw": [149, 172, 132],
    "mouth_corner": [61],
    "upper_lip_outer": [37, 39, 40],
    "lower_lip_outer": [84, 181, 91],
    "inner_mouth_corner": [78],
    "upper_lip_inner": [82, 80],
    "lower_lip_inner": [87, 88],
    "upper_teeth": [{80: 0.35, 82: 0.35, 87: 0.15, 88: 0.15}],
    "lower_teeth": [{80: 0.15, 82: 0.15, 87: 0.35, 88: 0.35}],
    "upper_lip_skin": [165],
    "lower_lip_skin": [(182, 194)],
    "chin": [32],
}
MIDLINE: dict[str, int | Mix] = {
    "hairline": 10,
    "forehead": 151,
    "glabella": 9,
    "nose_root": 168,
    "nose_bridge": 195,
    "nose_tip": 4,
    "nose_base": 2,
    "upper_lip_outer": 0,
    "upper_lip_inner": 13,
    "upper_teeth": {13: 0.7, 14: 0.3},
    "lower_teeth": {13: 0.3, 14: 0.7},
    "lower_lip_inner": 14,
    "lower_lip_outer": 17,
    "chin_crease": 18,
    "chin": 199,
    "menton": 152,
}

# What must be edges of triangles, so that the warp keeps these lines whole.
RIGHT_LINES = (
    "brow_upper.0 brow_upper.1 brow_upper.2 brow_upper.3 brow_upper.4",
    "brow_lower.0 brow_lower.1 brow_lower.2",
    "eye_inner upper_eyelid.0 upper_eyelid.1 upper_eyelid.2 upper_eyelid.3 eye_outer",
    "eye_inner lower_eyelid.0 lower_eyelid.1 lower_eyelid.2 eye_outer",
    # Only a pupil that leaves the lids then folds a triangle over.
    "eye_inner pupil eye_outer",
    "upper_eyelid.0 pupil lower_eyelid.0",
    "upper_eyelid.1 pupil lower_eyelid.1",
    "upper_eyelid.2 pupil lower_eyelid.2",
    "upper_eyelid.3 pupil",
    "upper_lip_outer upper_lip_outer.0 upper_lip_outer.1 upper_lip_outer.2 mouth_corner",
    "lower_lip_outer lower_lip_outer.0 lower_lip_outer.1 lower_lip_outer.2 mouth_corner",
    "upper_lip_inner upper_lip_inner.0 upper_lip_inner.1 inner_mouth_corner mouth_corner",
    "lower_lip_inner lower_lip_inner.0 lower_lip_inner.1 inner_mouth_corner",
    "upper_teeth right_upper_teeth inner_mouth_corner",
    "lower_teeth right_lower_teeth inner_mouth_corner",
    "nose_wing.0 nose_wing.1 nose_wing.2 nose_wing.3 nose_base",
    "nose_wing.1 nasolabial.0 nasolabial.1 nasolabial.2",
    "nasolabial.1 mouth_corner",
    "menton jaw.0 jaw.1 jaw.2 temple hairline.1 hairline.0 hairline",
)
"""A name on its own is the midline's where there is one, else the side's."""

# The sets below the whole face. SIDE stands for right and for left; a group's name for all of it.
EYE = "SIDE_eye_inner SIDE_eye_outer SIDE_upper_eyelid SIDE_lower_eyelid SIDE_pupil SIDE_lid_fold"
BROW = "SIDE_brow_upper SIDE_brow_lower"
OUTER = "SIDE_mouth_corner SIDE_upper_lip_outer SIDE_lower_lip_outer"
INNER = "SIDE_inner_mouth_corner SIDE_upper_lip_inner SIDE_lower_lip_inner"
TEETH = "SIDE_upper_teeth SIDE_lower_teeth"
SETS: dict[int, dict[str, str]] = {
    1: {
        "SIDE_eye_region": f"{BROW} {EYE} SIDE_eye_bag SIDE_forehead SIDE_hairline SIDE_temple "
        "SIDE_cheek.0 SIDE_cheek.1 hairline forehead glabella nose_root",
        "nose_region": "glabella nose_root nose_bridge nose_tip nose_base SIDE_eye_inner "
        "SIDE_nose_side SIDE_nose_wing SIDE_nasolabial.0 SIDE_cheek.0 "
        "SIDE_upper_lip_skin upper_lip_outer",
        "mouth_region": f"{OUTER} {INNER} {TEETH} upper_lip_outer upper_lip_inner upper_teeth "
        "lower_teeth lower_lip_inner lower_lip_outer chin_crease chin menton nose_base "
        "SIDE_nose_wing.2 SIDE_nose_wing.3 SIDE_nasolabial SIDE_cheek.2 SIDE_jaw "
        "SIDE_upper_lip_skin SIDE_lower_lip_skin SIDE_chin",
    },
    2: {
        "SIDE_brow": f"{BROW} SIDE_lid_fold SIDE_forehead glabella",
        "SIDE_eyelids": EYE,
        "SIDE_cheek": "SIDE_eye_bag SIDE_eye_outer SIDE_lower_eyelid SIDE_cheek SIDE_nasolabial "
        "SIDE_temple SIDE_jaw.1 SIDE_jaw.2",
        "forehead": "hairline forehead glabella SIDE_hairline SIDE_forehead SIDE_brow_upper "
        "SIDE_temple",
        "nose_bridge": "glabella nose_root nose_bridge SIDE_nose_side SIDE_eye_inner "
        "SIDE_brow_lower.0",
        "nose_tip": "nose_bridge nose_tip nose_base SIDE_nose_side SIDE_nose_wing "
        "SIDE_nasolabial.0",
        "SIDE_mouth_corner": "SIDE_mouth_corner SIDE_inner_mouth_corner SIDE_upper_lip_outer.1 "
        "SIDE_upper_lip_outer.2 SIDE_lower_lip_outer.1 SIDE_lower_lip_outer.2 SIDE_nasolabial.1 "
        "SIDE_nasolabial.2 SIDE_cheek.2",
        "upper_lip": "upper_lip_outer upper_lip_inner nose_base SIDE_mouth_corner "
        "SIDE_inner_mouth_corner SIDE_upper_lip_outer SIDE_upper_lip_inner SIDE_upper_lip_skin "
        "SIDE_nose_wing.3",
        "lower_lip": "lower_lip_outer lower_lip_inner chin_crease SIDE_mouth_corner "
        "SIDE_inner_mouth_corner SIDE_lower_lip_outer SIDE_lower_lip_inner SIDE_lower_lip_skin",
        "lip_line": f"upper_lip_inner lower_lip_inner {INNER}",
        "chin": "lower_lip_outer chin_crease chin menton SIDE_chin SIDE_lower_lip_skin SIDE_jaw",
        "teeth": f"upper_teeth lower_teeth {TEETH} upper_lip_inner lower_lip_inner "
        "SIDE_inner_mouth_corner",
    },
}
RIGID = "hairline nose_root SIDE_hairline SIDE_eye_inner"
"""What moves with the head alone: [Zhang 2006] section 12.1, and the root of the nose."""
