"""The 68 facial animation parameters of MPEG-4, and where on the mesh each is measured.

Source:
    ISO/IEC 14496-2 annex C, table C-1; where the feature points lie on this mesh is a choice of
    ours, listed in docs/reference/fap.md.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """One low-level parameter that a point's displacement gives.

    Attributes:
        number: 3 to 68.
        name: the standard's.
        points: features of the generic head, or `landmark.INDEX`; several: their mean.
        axis: 0 to 2 for x, y, z in head space.
        sign: which way along it counts as positive.
        unit: which distance in the face is 1024: "IRISD", "ES", "ENS", "MNS" or "MW".
        relative_to: features whose displacement does not count.
        one_way: never negative.
    """

    number: int
    name: str
    points: tuple[str, ...]
    axis: int
    sign: int
    unit: str
    relative_to: tuple[str, ...] = ()
    one_way: bool = False


COUNT = 68
HEAD_PITCH, HEAD_YAW, HEAD_ROLL = 48, 49, 50
EYE_YAW, EYE_PITCH, EYE_THRUST = (23, 24), (25, 26), (27, 28)
"""Left eye, then right eye."""

LEFT, RIGHT = (0, 1), (0, -1)
UP, DOWN, FORWARD = (1, 1), (1, -1), (2, 1)
JAW = ("left_jaw.0",)

_ROWS: tuple[tuple[int, str, str, tuple[int, int], str], ...] = (
    (3, "open_jaw", "left_jaw.0", DOWN, "MNS"),
    (4, "lower_t_midlip", "upper_lip_inner.3", DOWN, "MNS"),
    (5, "raise_b_midlip", "lower_lip_inner.3", UP, "MNS"),
    (6, "stretch_l_cornerlip", "upper_lip_inner.6", LEFT, "MW"),
    (7, "stretch_r_cornerlip", "upper_lip_inner.0", RIGHT, "MW"),
    (8, "lower_t_lip_lm", "upper_lip_inner.4 upper_lip_inner.5", DOWN, "MNS"),
    (9, "lower_t_lip_rm", "upper_lip_inner.1 upper_lip_inner.2", DOWN, "MNS"),
    (10, "raise_b_lip_lm", "lower_lip_inner.4 lower_lip_inner.5", UP, "MNS"),
    (11, "raise_b_lip_rm", "lower_lip_inner.1 lower_lip_inner.2", UP, "MNS"),
    (12, "raise_l_cornerlip", "upper_lip_inner.6", UP, "MNS"),
    (13, "raise_r_cornerlip", "upper_lip_inner.0", UP, "MNS"),
    (14, "thrust_jaw", "left_jaw.0", FORWARD, "MNS"),
    (15, "shift_jaw", "left_jaw.0", RIGHT, "MW"),
    (16, "push_b_lip", "lower_lip_inner.3", FORWARD, "MNS"),
    (17, "push_t_lip", "upper_lip_inner.3", FORWARD, "MNS"),
    (18, "depress_chin", "chin", UP, "MNS"),
    (19, "close_t_l_eyelid", "left_upper_eyelid.3", DOWN, "IRISD"),
    (20, "close_t_r_eyelid", "right_upper_eyelid.3", DOWN, "IRISD"),
    (21, "close_b_l_eyelid", "left_lower_eyelid.3", UP, "IRISD"),
    (22, "close_b_r_eyelid", "right_lower_eyelid.3", UP, "IRISD"),
    (31, "raise_l_i_eyebrow", "left_eyebrow_upper.0 left_eyebrow_lower.0", UP, "ENS"),
    (32, "raise_r_i_eyebrow", "right_eyebrow_upper.0 right_eyebrow_lower.0", UP, "ENS"),
    (33, "raise_l_m_eyebrow", "left_eyebrow_upper.2 left_eyebrow_lower.2", UP, "ENS"),
    (34, "raise_r_m_eyebrow", "right_eyebrow_upper.2 right_eyebrow_lower.2", UP, "ENS"),
    (35, "raise_l_o_eyebrow", "left_eyebrow_upper.4 left_eyebrow_lower.4", UP, "ENS"),
    (36, "raise_r_o_eyebrow", "right_eyebrow_upper.4 right_eyebrow_lower.4", UP, "ENS"),
    (37, "squeeze_l_eyebrow", "left_eyebrow_upper.0 left_eyebrow_lower.0", RIGHT, "ES"),
    (38, "squeeze_r_eyebrow", "right_eyebrow_upper.0 right_eyebrow_lower.0", LEFT, "ES"),
    (39, "puff_l_cheek", "landmark.425", LEFT, "ES"),
    (40, "puff_r_cheek", "landmark.205", RIGHT, "ES"),
    (41, "lift_l_cheek", "landmark.347", UP, "ENS"),
    (42, "lift_r_cheek", "landmark.118", UP, "ENS"),
    (43, "shift_tongue_tip", "tongue_tip", RIGHT, "MW"),
    (44, "raise_tongue_tip", "tongue_tip", UP, "MNS"),
    (45, "thrust_tongue_tip", "tongue_tip", FORWARD, "MW"),
    (51, "lower_t_midlip_o", "upper_lip_outer.4", DOWN, "MNS"),
    (52, "raise_b_midlip_o", "lower_lip_outer.4", UP, "MNS"),
    (53, "stretch_l_cornerlip_o", "left_mouth_corner", LEFT, "MW"),
    (54, "stretch_r_cornerlip_o", "right_mouth_corner", RIGHT, "MW"),
    (55, "lower_t_lip_lm_o", "upper_lip_outer.6", DOWN, "MNS"),
    (56, "lower_t_lip_rm_o", "upper_lip_outer.2", DOWN, "MNS"),
    (57, "raise_b_lip_lm_o", "lower_lip_outer.6", UP, "MNS"),
    (58, "raise_b_lip_rm_o", "lower_lip_outer.2", UP, "MNS"),
    (59, "raise_l_cornerlip_o", "left_mouth_corner", UP, "MNS"),
    (60, "raise_r_cornerlip_o", "right_mouth_corner", UP, "MNS"),
    (61, "stretch_l_nose", "left_nose_wing", LEFT, "ENS"),
    (62, "stretch_r_nose", "right_nose_wing", RIGHT, "ENS"),
    (63, "raise_nose", "nose_tip", UP, "ENS"),
    (64, "bend_nose", "nose_tip", RIGHT, "ENS"),
    (65, "raise_l_ear", "left_ear.1", UP, "ENS"),
    (66, "raise_r_ear", "right_ear.1", UP, "ENS"),
    (67, "pull_l_ear", "left_ear.3", LEFT, "ENS"),
    (68, "pull_r_ear", "right_ear.3", RIGHT, "ENS"),
)

_ONE_WAY = frozenset(("open_jaw", "thrust_jaw", "lift_l_cheek", "lift_r_cheek"))

PARAMETERS: tuple[Parameter, ...] = tuple(
    Parameter(
        number,
        name,
        tuple(points.split()),
        *direction,
        unit,
        # The jaw carries the chin along; the parameter means what the chin does by itself.
        relative_to=JAW if name == "depress_chin" else (),
        one_way=name in _ONE_WAY,
    )
    for number, name, points, direction, unit in _ROWS
)
"""What points' displacements give. Without a place on the mesh, and masked out: 1 and 2 (visemes
and expressions), 29 and 30 (pupils), 46 and 47 (the tongue's middle and sides)."""

MEASURED = frozenset(
    (
        *(parameter.number for parameter in PARAMETERS),
        *(*EYE_YAW, *EYE_PITCH, *EYE_THRUST, HEAD_PITCH, HEAD_YAW, HEAD_ROLL),
    )
)
