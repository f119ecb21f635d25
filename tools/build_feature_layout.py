"""Writes src/mien/assets/data/zhang134.json: python -m tools.build_feature_layout.

The points are drawn once, on the subject's right and the midline; the left is their mirror image.
The template is the generic head from the front, its jaw half open.
"""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import Delaunay

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from tools.assets.feature_drawing import MIDLINE, RIGHT, RIGHT_LINES, RIGID, SETS, Mix
from tools.assets.forced_edges import cross, with_edge

OUT = Path(__file__).parents[1] / "src" / "mien" / "assets" / "data" / "zhang134.json"
JAW_OPEN = 0.6
FRAME_POINTS = 16
FRAME_REACH = (0.78, 1.0)
"""Half width and half height of the frame, in widths of the face."""
FRAME_CENTRE = (0.0, 0.3)


def main() -> None:
    """Writes the layout."""
    landmarks, counterpart = front_view()
    weights = {name: as_row(mix) for name, mix in drawn_points().items()}
    for name in [name for name in weights if name.startswith("right_")]:
        weights[mirrored(name)] = weights[name][counterpart]
    names = list(weights)
    template = np.array([weights[name] @ landmarks for name in names])
    template /= np.ptp(template[:, 0])
    frame = frame_ellipse()
    document = {
        "format": "mien feature points",
        "version": 1,
        "name": "zhang134",
        "points": [
            {
                "name": name,
                "mirror": mirrored(name),
                "template": rounded(place),
                "landmarks": {
                    str(i): round(weights[name][i], 3) for i in np.flatnonzero(weights[name])
                },
            }
            for name, place in zip(names, template, strict=True)
        ],
        "rigid": expanded(RIGID, names),
        "frame": [rounded(place) for place in frame],
        "sets": [{"whole_face": names}, *(all_sets(SETS[level], names) for level in (1, 2))],
        "triangles": triangulated(names, template, frame).tolist(),
    }
    OUT.write_text(compact(document), encoding="utf-8")


def front_view() -> tuple[Array, Array]:
    """The landmarks on the generic head from the front, (478, 2), and each one's counterpart."""
    head = load_generic_head()
    jaw = head.unit_offsets[head.unit_names.index("jawOpen")]
    landmarks = head.landmark_positions(head.mesh.vertices + JAW_OPEN * jaw)
    mirror_image = landmarks * [-1, 1, 1]
    distances = np.linalg.norm(landmarks[:, None] - mirror_image, axis=2)
    _, counterpart = linear_sum_assignment(distances)
    assert (counterpart[counterpart] == np.arange(len(landmarks))).all()
    even = (landmarks + mirror_image[counterpart]) / 2
    return even[:, :2] * [1, -1], counterpart


def drawn_points() -> dict[str, Mix]:
    """The right side's points and the midline's."""
    points: dict[str, Mix] = {}
    for group, entries in RIGHT.items():
        for number, entry in enumerate(entries):
            suffix = f".{number}" if len(entries) > 1 else ""
            points[f"right_{group}{suffix}"] = as_mix(entry)
    return points | {name: as_mix(entry) for name, entry in MIDLINE.items()}


def as_mix(entry: int | tuple[int, int] | Mix) -> Mix:
    if isinstance(entry, int):
        return {entry: 1.0}
    return dict.fromkeys(entry, 0.5) if isinstance(entry, tuple) else entry


def as_row(mix: Mix) -> Array:
    row = np.zeros(478)
    row[list(mix)] = list(mix.values())
    return row


def mirrored(name: str) -> str:
    side, _, rest = name.partition("_")
    return {"right": f"left_{rest}", "left": f"right_{rest}"}.get(side, name)


def expanded(tokens: str, names: list[str], side: str = "") -> list[str]:
    """The names that these tokens stand for, in the layout's order."""
    wanted = set()
    for token in tokens.split():
        for chosen in (side,) if side else ("right", "left"):
            wanted.add(token.replace("SIDE", chosen))
    found = [n for n in names if n in wanted or n.rpartition(".")[0] in wanted]
    assert wanted <= {*found, *(n.rpartition(".")[0] for n in found)}, wanted
    return found


def all_sets(drawn: dict[str, str], names: list[str]) -> dict[str, list[str]]:
    """The sets of a level, those of one side for both."""
    sets = {}
    for name, tokens in drawn.items():
        if name.startswith("SIDE"):
            for side in ("right", "left"):
                sets[name.replace("SIDE", side)] = expanded(tokens, names, side)
        else:
            sets[name] = expanded(tokens, names)
    return sets


def frame_ellipse() -> Array:
    """Points on an ellipse around the face, the first at its top."""
    angles = 2 * np.pi * np.arange(FRAME_POINTS) / FRAME_POINTS
    return FRAME_CENTRE + np.column_stack([np.sin(angles), -np.cos(angles)]) * FRAME_REACH


def triangulated(names: list[str], template: Array, frame: Array) -> Array:
    """Triangles over points and frame: those of the right half and their mirror images."""
    places = np.vstack([template, frame])
    mirror = np.array([names.index(mirrored(name)) for name in names])
    mirror = np.append(mirror, len(names) + (-np.arange(len(frame))) % len(frame))
    half = np.flatnonzero(places[:, 0] < 1e-9)
    triangles = half[Delaunay(places[half]).simplices]
    for start, end in drawn_edges(names):
        triangles = with_edge(triangles, places, start, end)
    triangles = np.vstack([triangles, mirror[triangles]])
    a, b, c = places[triangles].transpose(1, 0, 2)
    clockwise = cross(b - a, c - a) > 0
    triangles[~clockwise] = triangles[~clockwise][:, ::-1]
    return triangles


def drawn_edges(names: list[str]) -> list[tuple[int, int]]:
    edges = []
    for line in RIGHT_LINES:
        on_line = [n if n in names else f"right_{n}" for n in line.split()]
        edges += [(names.index(a), names.index(b)) for a, b in pairwise(on_line)]
    return edges


def rounded(place: Array) -> list[float]:
    # Adding 0 turns -0.0 into 0.0.
    return [round(float(number), 5) + 0.0 for number in place]


def compact(document: dict[str, Any]) -> str:
    """JSON with one point, set or row of numbers a line."""
    text = json.dumps(document, indent=1)
    for _ in range(2):  # Innermost lists and objects first.
        text = re.sub(
            r"([\[{])\s+([^\[\]{}]*?)\s+([\]}])",
            lambda found: found[1] + re.sub(r"\s*\n\s*", " ", found[2]) + found[3],
            text,
        )
    return text + "\n"


if __name__ == "__main__":
    main()
