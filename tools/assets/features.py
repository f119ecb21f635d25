"""The named points and feature curves, as vertices of the head.

The paths below follow the edge loops that hm08's modeller laid around eyes, lips, nose, ear and
jaw; they name hm08 vertices on the subject's left side, and the right side is their mirror image.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.arrays import Array, Float, Int
from tools.assets.head import HeadCut

# Where the forehead's skin meets the hair, from the midline to the left temple.
HAIRLINE = (983, 7679, 7678, 7017, 7016, 11838, 11839, 11843, 11842, 11848)
# The lower border of the jaw, from below the chin to the left ear lobe.
JAW = (5296, 11897, 11898, 11899, 7618, 7619, 10366, 7594, 7595, 7460, 7459, 7613, 7571, 12349)
# Paired curves: from the midline outwards; number of vertices that the curve keeps.
_PAIRED: dict[str, tuple[int, tuple[int, ...]]] = {
    "eyebrow_upper": (5, (6983, 6980, 6979, 6981, 6982, 6987)),
    "eyebrow_lower": (5, (6984, 6956, 6953, 6952, 6954, 6955, 6966)),
    "upper_eyelid": (
        7,
        (6850, 6847, 6886, 6844, 6841, 6838, 6785, 6784, 6790, 6793, 6796, 6799, 6802, 6805),
    ),
    "lower_eyelid": (
        7,
        (
            *(6850, 6853, 6856, 6837, 11695, 6834, 6831, 6828),
            *(6825, 6820, 6817, 6814, 11693, 6811, 6808, 6805),
        ),
    ),
    "nostril": (5, (7077, 7054, 7095, 7055, 7080, 7099, 11673, 11672, 7102, 7101, 7051)),
    "jaw": (7, JAW),
    "ear": (
        7,
        (
            *(12353, 12012, 12015, 12021, 12016, 12022, 12018, 12040, 12039, 12061, 12051),
            *(12166, 12052, 12053, 12050, 12049, 12027, 12340, 12005, 12358, 12349),
        ),
    ),
}
# Single curves: their left half, from the midline outwards.
_SINGLE: dict[str, tuple[int, tuple[int, ...]]] = {
    "upper_lip_outer": (
        9,
        (455, 7214, 7210, 7215, 7169, 11956, 7170, 7171, 7168, 7184, 7187, 7185),
    ),
    "lower_lip_outer": (9, (492, 7241, 7235, 7166, 7165, 7164, 10371, 7186, 7185)),
    "upper_lip_inner": (
        7,
        (520, 7267, 7268, 7261, 7262, 11962, 7263, 7179, 7178, 7190, 7185),
    ),
    "lower_lip_inner": (7, (523, 7264, 7265, 7266, 7206, 7205, 7249, 7185)),
    "hairline": (9, HAIRLINE),
}
_NOSE_RIDGE_COUNT = 5


def find_features(head: HeadCut) -> tuple[dict[str, int], dict[str, tuple[int, ...]]]:
    """The 13 points and the polylines.

    Returns:
        vertex by name; vertices along each curve by name.
    """
    polylines: dict[str, tuple[int, ...]] = {}
    for name, (count, path) in _PAIRED.items():
        left = _spaced(head.from_hm08(path), head.vertices, count)
        polylines[f"left_{name}"] = left
        polylines[f"right_{name}"] = tuple(int(head.mirror[vertex]) for vertex in left)
    for name, (count, path) in _SINGLE.items():
        half = _spaced(head.from_hm08(path), head.vertices, count // 2 + 1)
        right = tuple(int(head.mirror[vertex]) for vertex in half[:0:-1])
        polylines[name] = right + half
    ridge = _midline_ridge(head)
    polylines["nose_ridge"] = _spaced(ridge, head.vertices, _NOSE_RIDGE_COUNT)
    return _points(head, polylines), dict(sorted(polylines.items()))


def brow_mask(head: HeadCut, polylines: dict[str, tuple[int, ...]]) -> Float[Array, " v"]:
    """(V,) 1 on the skin within the eyebrows, falling to 0 beside them."""
    mask = np.zeros(len(head.vertices))
    for side in ("left", "right"):
        upper, lower = (polylines[f"{side}_eyebrow_{edge}"] for edge in ("upper", "lower"))
        middle = (head.vertices[list(upper)] + head.vertices[list(lower)]) / 2
        steps = np.linspace(0, len(middle) - 1, 40)
        line = np.column_stack([np.interp(steps, range(len(middle)), axis) for axis in middle.T])
        distance = np.linalg.norm(head.vertices[:, None] - line[None], axis=2).min(1)
        mask = np.maximum(mask, np.clip(1.6 - distance / 4, 0, 1))
    mask[head.vertices_of("skin").max() + 1 :] = 0
    return mask


def _points(head: HeadCut, polylines: dict[str, tuple[int, ...]]) -> dict[str, int]:
    """[Pighin 2002]'s 13 points: ends of curves and extremal vertices."""
    left = {
        "eye_outer": polylines["left_upper_eyelid"][-1],
        "eye_inner": polylines["left_upper_eyelid"][0],
        "nose_wing": max(polylines["left_nostril"], key=lambda v: float(head.vertices[v, 0])),
        "mouth_corner": polylines["upper_lip_outer"][-1],
        "ear_lobe": polylines["left_ear"][-1],
    }
    points = {f"left_{name}": vertex for name, vertex in left.items()}
    points |= {f"right_{name}": int(head.mirror[vertex]) for name, vertex in left.items()}
    points["nose_root"], points["nose_tip"] = (polylines["nose_ridge"][i] for i in (0, -1))
    midline = _front_midline(head)
    heights = head.vertices[midline, 1]
    lip = head.vertices[polylines["lower_lip_outer"][4], 1]
    chin = midline[(heights < lip - 12) & (heights > head.vertices[:, 1].min() + 30)]
    points["chin"] = int(chin[np.argmax(head.vertices[chin, 2])])
    return dict(sorted(points.items()))


def _front_midline(head: HeadCut) -> Int[Array, " n"]:
    """Vertices of the skin on the midline of the face, from top to bottom."""
    skin = head.vertices_of("skin")
    own = skin[head.mirror[skin] == skin]
    front = own[head.vertices[own, 2] > 0]
    return front[np.argsort(-head.vertices[front, 1], kind="stable")]


def _midline_ridge(head: HeadCut) -> list[int]:
    """From the deepest point between the eyes down to the tip of the nose."""
    midline = _front_midline(head)
    y, z = head.vertices[midline, 1], head.vertices[midline, 2]
    bridge = np.flatnonzero((y < 15) & (y > -12))
    root = bridge[np.argmin(z[bridge])]
    nose = np.flatnonzero((y <= y[root]) & (y > y[root] - 60))
    tip = nose[np.argmax(z[nose])]
    return [int(vertex) for vertex in midline[root : tip + 1]]


def _spaced(path: Sequence[int], vertices: Float[Array, "v 3"], count: int) -> tuple[int, ...]:
    """The vertices of a path, both ends included, that divide its length most evenly.

    Of all choices that keep the order it is the one with the least sum of squared steps.
    """
    steps = np.linalg.norm(np.diff(vertices[list(path)], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    cost = along**2
    cost[0] = np.inf
    came_from = []
    for _ in range(count - 2):
        candidates = cost[:, None] + (along[None] - along[:, None]) ** 2
        candidates[np.tril_indices(len(path))] = np.inf
        came_from.append(candidates.argmin(0))
        cost = candidates.min(0)
    chosen = [len(path) - 1]
    for previous in reversed(came_from):
        chosen.append(int(previous[chosen[-1]]))
    return tuple(int(path[i]) for i in (0, *reversed(chosen)))
