"""MPEG-4 facial animation parameters: a performance as feature points' displacements.

Values are whole numbers of FAPU / 1024, distances in this face at rest, so that another face of
other proportions can play them; angles are in 1e-5 rad.

Source:
    ISO/IEC 14496-2 annex C; [Pighin 2002] sec. 7.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryFile

import numpy as np

from mien.animate.channels import head_angles_rad
from mien.arrays import Array, Float, Int, check_array, check_rotation, frozen
from mien.assets.generic import load_generic_head
from mien.errors import EstimationError, InputError, escaped
from mien.io.files.atomic import atomic_file
from mien.io.timeline.fap_table import (
    COUNT,
    EYE_PITCH,
    EYE_THRUST,
    EYE_YAW,
    HEAD_PITCH,
    HEAD_ROLL,
    HEAD_YAW,
    MEASURED,
    PARAMETERS,
)

FILE_VERSION = "2.1"
ANGLE_UNIT = 1e-5
EYEBALLS = ("left_eyeball", "right_eyeball")


@dataclass(frozen=True)
class Fapu:
    """The distances in a face at rest that parameters are measured by, mm.

    Attributes:
        IRISD: between upper and lower lid.
        ES: between the eyes.
        ENS: from the eyes' height to the nose's base.
        MNS: from there to the mouth.
        MW: the mouth's width.
    """

    IRISD: float
    ES: float
    ENS: float
    MNS: float
    MW: float


def measure_fapu(vertices: Float[Array, "v 3"]) -> Fapu:
    """The units of a head at rest.

    Args:
        vertices: (V, 3) mm, head space, of the generic head's topology.

    Raises:
        InputError: another shape.
        EstimationError: a distance of 0 or less.
    """
    vertices = _check_vertices("vertices", vertices)
    left, right = (_eyeball(vertices, side).mean(axis=0) for side in EYEBALLS)
    nose = _position(vertices, ("left_nostril.0", "right_nostril.0"))
    lids = [
        _position(vertices, (f"{side}_upper_eyelid.3",))
        - _position(vertices, (f"{side}_lower_eyelid.3",))
        for side in ("left", "right")
    ]
    corners = [_position(vertices, (f"{side}_mouth_corner",)) for side in ("left", "right")]
    fapu = Fapu(
        IRISD=float((lids[0] + lids[1])[1]) / 2,
        ES=float((left - right)[0]),
        ENS=float((left + right)[1] / 2 - nose[1]),
        MNS=float(nose[1] - _position(vertices, ("upper_lip_inner.3",))[1]),
        MW=float((corners[0] - corners[1])[0]),
    )
    for name, distance in vars(fapu).items():
        if distance <= 0:
            raise EstimationError(f"the face at rest has {name}0 = {distance:.2f} mm, not above 0")
    return fapu


@dataclass(frozen=True)
class FapMeter:
    """Reads a head's parameters off its moved vertices.

    Attributes:
        neutral: (V, 3) mm, head space: the head at rest.
        fapu: its units.
    """

    neutral: Float[Array, "v 3"]
    fapu: Fapu

    @classmethod
    def of(cls, neutral: Float[Array, "v 3"]) -> FapMeter:
        """The meter for a head. Raises: as measure_fapu."""
        return cls(frozen(_check_vertices("neutral", neutral)), measure_fapu(neutral))

    def read(
        self, vertices: Float[Array, "v 3"], rotation: Float[Array, "3 3"] | None = None
    ) -> Int[Array, " 68"]:
        """(68,) the parameters of a face; entry i is number i + 1, 0 where none is measured.

        Args:
            vertices: (V, 3) mm, head space: the face, the head itself unmoved.
            rotation: of the head.

        Raises:
            InputError: another shape, a matrix that is no rotation.
        """
        vertices = _check_vertices("vertices", vertices)
        moved = vertices - self.neutral
        values = np.zeros(COUNT + 1)
        for item in PARAMETERS:
            shift = _position(moved, item.points)
            if item.relative_to:
                shift = shift - _position(moved, item.relative_to)
            value = 1024 * item.sign * shift[item.axis] / getattr(self.fapu, item.unit)
            values[item.number] = max(0.0, value) if item.one_way else value
        for index, side in enumerate(EYEBALLS):
            at_rest, now = _eyeball(self.neutral, side), _eyeball(vertices, side)
            yaw, pitch, _ = head_angles_rad(_turn(at_rest, now), order="YXZ")
            values[[EYE_YAW[index], EYE_PITCH[index]]] = np.array([yaw, pitch]) / ANGLE_UNIT
            thrust = now.mean(axis=0)[2] - at_rest.mean(axis=0)[2]
            values[EYE_THRUST[index]] = 1024 * thrust / self.fapu.ES
        if rotation is not None:
            yaw, pitch, roll = head_angles_rad(check_rotation("rotation", rotation), order="YXZ")
            head = [HEAD_YAW, HEAD_PITCH, HEAD_ROLL]
            values[head] = np.array([yaw, pitch, roll]) / ANGLE_UNIT
        return np.round(values[1:]).astype(np.int64)


def save_fap(
    path: str | Path, values: Iterable[Int[Array, " 68"]], fps: float, *, name: str | None = None
) -> int:
    """Write parameters as a text .fap file, whole or not at all.

    The first line is `2.1 NAME FPS FRAMES`; then each frame has a line of 68 ones and zeros, which
    parameters follow, and one with the frame's number and their values.

    Args:
        path: the file.
        values: (68,) a frame, as FapMeter.read gives them.
        fps: frames a second; the format has whole numbers only.
        name: of the performance; the file's own unless given.

    Returns:
        how many frames were written.

    Raises:
        InputError: no frame, a rate that is no whole number, a place that cannot be written.
    """
    if not (fps >= 1 and float(fps).is_integer()):
        expected = "a whole number of frames a second, which is all that it can say"
        raise InputError(path, expected, f"{fps:g}")
    title = "_".join(escaped(name or Path(path).stem).split()) or "mien"
    mask = " ".join("1" if number in MEASURED else "0" for number in range(1, COUNT + 1))
    chosen, count = np.array(sorted(MEASURED)) - 1, 0
    # The first line holds the count, which is known at the end.
    with TemporaryFile("w+", encoding="utf-8", newline="\n") as body:
        for count, frame_values in enumerate(values, 1):
            row = check_array(f"frame {count - 1}", frame_values, (COUNT,), dtype=int)
            body.write(f"{mask}\n{' '.join(map(str, [count - 1, *row[chosen].tolist()]))}\n")
        if not count:
            raise InputError(path, "at least one frame to write", "none")
        body.seek(0)
        with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
            file.write(f"{FILE_VERSION} {title} {int(fps)} {count}\n")
            copyfileobj(body, file)
    return count


def _position(vertices: Array, points: tuple[str, ...]) -> Float[Array, " 3"]:
    """The mean of some points; what holds for vertices holds for displacements."""
    weights = [_weights(point) for point in points]
    return np.mean([w @ vertices[list(v)] for v, w in weights], axis=0)


@cache
def _weights(point: str) -> tuple[tuple[int, ...], Array]:
    """The vertices that a point lies between, and how much each counts."""
    generic = load_generic_head()
    mesh = generic.mesh
    kind, _, index = point.partition(".")
    if kind == "landmark":
        corners = mesh.triangles[generic.landmark_triangles[int(index)]]
        return tuple(corners.tolist()), generic.landmark_barycentrics[int(index)]
    if kind == "tongue_tip":
        tongue = _part("tongue")
        depth = mesh.vertices[tongue, 2]
        near = tongue[depth > depth.max() - 1.0]
        return tuple(near.tolist()), np.full(len(near), 1 / len(near))
    return (generic.vertex_of(point),), np.ones(1)


@cache
def _part(name: str) -> Int[Array, " n"]:
    mesh = load_generic_head().mesh
    return np.unique(mesh.triangles[mesh.part == mesh.part_names.index(name)])


def _eyeball(vertices: Array, name: str) -> Float[Array, "n 3"]:
    return vertices[_part(name)]


def _turn(at_rest: Array, now: Array) -> Float[Array, "3 3"]:
    """The rotation that takes one set of points closest to the other, about their centres."""
    from scipy.spatial.transform import Rotation

    centred = (now - now.mean(axis=0), at_rest - at_rest.mean(axis=0))
    return Rotation.align_vectors(*centred)[0].as_matrix()


def _check_vertices(name: str, vertices: object) -> Float[Array, "v 3"]:
    return check_array(name, vertices, load_generic_head().mesh.vertices.shape)
