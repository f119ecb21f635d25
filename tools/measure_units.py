"""Measures the figures of docs/notes/face-units.md: python -m tools.measure_units HEAD.

HEAD is a head folder, made by `mien build`; without one the generic head is measured. Depths are
in mm: of lids in the eyeballs, of one lip in the other, both beyond what they are when the face is
neutral. "Live" is after the contact step. Times are on one thread.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.io.head.head_folder import load_head
from mien.render.shade import rasterize_mesh
from mien.rig.deformer import Contacts, FaceDeformer, fit_units
from mien.rig.gaze import SIDES
from mien.rig.unit_transfer import transfer_units

_MIN_MM = 0.1
_VIEWS = [(yaw, pitch) for yaw in (-30, 0, 30) for pitch in (-20, 0, 20)]
_PX_PER_MM = 30.0
_DISTANCE_MM = 700.0


def main(folder: str | None = None) -> None:
    """Prints the tables."""
    generic = load_generic_head()
    neutral = np.array((load_head(Path(folder)) if folder else generic).mesh.vertices)
    transferred, units = transfer_units(generic, neutral), fit_units(generic, neutral)
    deformer = FaceDeformer.of(generic, neutral, units)
    _print_depths(generic, neutral, transferred, units, deformer)
    _print_closed_eyes(generic, neutral, units, deformer)
    _print_times(generic, neutral, units, deformer)


def lid_depth(contacts: Contacts, vertices: Float[Array, "v 3"]) -> float:
    """mm that the deepest vertex of a lid's front is in the eyeball's clearance."""
    depths = [
        float((lids.min_radius - lids.spherical(vertices)[:, 2]).max()) * lids.eyeball.radius
        for lids in contacts.lids
    ]
    return max(*depths, 0.0)


def lip_depth(contacts: Contacts, vertices: Float[Array, "v 3"]) -> float:
    """mm that one lip is deeper in the other than when the face is neutral."""
    return float((contacts.lips.depths(vertices) - contacts.lips.allowed).max())


def _print_depths(
    generic: GenericHead,
    neutral: Float[Array, "v 3"],
    transferred: Float[Array, "52 v 3"],
    units: Float[Array, "52 v 3"],
    deformer: FaceDeformer,
) -> None:
    contacts = deformer.contacts
    jaw = generic.unit_names.index("jawOpen")
    for part, depth in (("lids", lid_depth), ("lips", lip_depth)):
        print(f"\n| {part}, at weight 1 | transferred | corrected | half | live |")
        print("| --- | ---: | ---: | ---: | ---: |")
        for index, name in enumerate(generic.unit_names):
            chosen = [index, jaw] if name == "mouthClose" else [index]
            raw, sound = (neutral + table[chosen].sum(axis=0) for table in (transferred, units))
            live = deformer.deform(neutral, np.eye(len(units))[chosen].sum(axis=0))
            states = [raw, sound, (neutral + sound) / 2, live]
            found = [depth(contacts, state) for state in states]
            if max(found) > _MIN_MM:
                title = " + ".join(generic.unit_names[n] for n in chosen)
                print(f"| {title} |", " | ".join(f"{d:.2f}" for d in found), "|")


def _print_closed_eyes(
    generic: GenericHead,
    neutral: Float[Array, "v 3"],
    units: Float[Array, "52 v 3"],
    deformer: FaceDeformer,
) -> None:
    print(f"\n| pixels of eyeball, {len(_VIEWS)} views, {_PX_PER_MM:g} px/mm | offsets | live |")
    print("| --- | ---: | ---: |")
    for others in ((), ("eyeLookDown",), ("eyeLookUp",), ("eyeSquint", "cheekSquint")):
        names = ("eyeBlink", *others)
        chosen = [
            generic.unit_names.index(f"{name}{side.capitalize()}")
            for name in names
            for side in SIDES
        ]
        live = deformer.deform(neutral, np.eye(len(units))[chosen].sum(axis=0))
        states = (neutral + units[chosen].sum(axis=0), live)
        counts = [sum(_eyeball_pixels(generic, state, side) for side in SIDES) for state in states]
        print(f"| {' + '.join(names)} | {counts[0]} | {counts[1]} |")


def _eyeball_pixels(generic: GenericHead, vertices: Float[Array, "v 3"], side: str) -> int:
    target = vertices[list(generic.polylines[f"{side}_lower_eyelid"])].mean(axis=0)
    mesh, ball = generic.mesh.with_vertices(vertices), f"{side}_eyeball"
    shown = mesh.submesh(mesh.triangles_of("skin", ball))
    count = 0
    for yaw, pitch in _VIEWS:
        ids = rasterize_mesh(
            shown, _camera(target, np.radians(yaw), np.radians(pitch))
        ).triangle_ids
        count += int((shown.part[ids[ids >= 0]] == mesh.part_names.index(ball)).sum())
    return count


def _camera(target: Float[Array, " 3"], yaw: float, pitch: float) -> Camera:
    c, s = np.cos(yaw), np.sin(yaw)
    about_y = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    c, s = np.cos(pitch), np.sin(pitch)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    rotation = np.diag([1.0, -1.0, -1.0]) @ about_x @ about_y
    place = np.array([0, 0, _DISTANCE_MM]) - rotation @ target
    return Camera(1200, 750, _PX_PER_MM * _DISTANCE_MM, rotation, place)


def _print_times(
    generic: GenericHead,
    neutral: Float[Array, "v 3"],
    units: Float[Array, "52 v 3"],
    deformer: FaceDeformer,
) -> None:
    def posed(**weights: float) -> Array:
        added = [w * units[generic.unit_names.index(name)] for name, w in weights.items()]
        return neutral + np.sum(added, axis=0)

    apart, lids = posed(jawOpen=0.3), posed(eyeBlinkLeft=1.0, eyeLookDownLeft=1.0)
    lips = posed(mouthPucker=1.0, mouthShrugLower=0.6)
    print("\n| ms | |\n| --- | ---: |")
    for title, rounds, run in (
        ("transfer_units", 3, lambda: transfer_units(generic, neutral)),
        ("fit_units", 3, lambda: fit_units(generic, neutral)),
        ("FaceDeformer.of", 3, lambda: FaceDeformer.of(generic, neutral, units)),
        ("resolved, no contact", 200, lambda: deformer.contacts.resolve(apart)),
        ("resolved, lids", 200, lambda: deformer.contacts.resolve(lids)),
        ("resolved, lips", 200, lambda: deformer.contacts.resolve(lips)),
    ):
        print(f"| {title} | {_median_ms(run, rounds):.2f} |")


def _median_ms(run: Callable[[], object], rounds: int) -> float:
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))


if __name__ == "__main__":
    main(*sys.argv[1:])
