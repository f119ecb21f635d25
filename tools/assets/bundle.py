"""Puts the parts of the generic head together as the arrays that mien reads."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.mesh import Mesh
from tools.assets.atlas import pack
from tools.assets.attachments import attach
from tools.assets.calibration import find_amplitude, sample_surface
from tools.assets.features import brow_mask, find_features
from tools.assets.hair import add_hair, scalp_mask
from tools.assets.head import PART_NAMES, HeadCut, cut_head
from tools.assets.identity import principal_modes, sample_heads
from tools.assets.makehuman import MakeHuman
from tools.assets.regions import build_regions
from tools.assets.shading import paint_head
from tools.assets.skull import follow_with_scalp
from tools.assets.triangles import triangulate
from tools.assets.units import build_units

_SEED = 2002
_HEADS = 800
_MODES = 60
_FOR_LANDMARKS = ("skin", "left_eyeball", "right_eyeball")


def build_arrays(source: MakeHuman, model: bytes) -> dict[str, Array]:
    """Everything that `mien.assets.generic` reads, by key.

    Args:
        source: MakeHuman's files.
        model: the face landmarker's model.
    """
    bald = cut_head(source)
    scalp = scalp_mask(bald)
    head = add_hair(bald, scalp)
    mesh = build_mesh(source, head)
    points, polylines = find_features(head)
    regions = build_regions(source, head, scalp)
    return {
        **_mesh_arrays(mesh),
        "mirror": head.mirror.astype(np.uint16),
        **_unit_arrays(*build_units(source, head, polylines)),
        "identity_components": _identity(source, head, mesh, regions).astype(np.float16),
        "region_names": np.array(list(regions)),
        "regions": np.stack(list(regions.values())),
        "point_names": np.array(list(points)),
        "points": np.array(list(points.values()), np.uint16),
        "polyline_names": np.array(list(polylines)),
        "polyline_lengths": np.array([len(line) for line in polylines.values()], np.uint16),
        "polyline_vertices": np.concatenate(list(polylines.values())).astype(np.uint16),
        **_landmark_arrays(mesh, regions, brow_mask(head, polylines), model),
    }


def build_mesh(source: MakeHuman, head: HeadCut) -> Mesh:
    """The head's quads as a textured mesh of triangles."""
    corners = triangulate(head.quads, head.mirror, head.vertices)
    uvs, uv_quads = pack(source, head)
    return Mesh(
        vertices=head.vertices,
        triangles=np.take_along_axis(np.repeat(head.quads, 2, axis=0), corners, axis=1),
        uvs=uvs,
        uv_triangles=np.take_along_axis(np.repeat(uv_quads, 2, axis=0), corners, axis=1),
        part=np.repeat(head.quad_part, 2).astype(np.uint8),
        part_names=PART_NAMES,
    )


def _mesh_arrays(mesh: Mesh) -> dict[str, Array]:
    return {
        "vertices": mesh.vertices.astype(np.float32),
        "triangles": mesh.triangles.astype(np.uint16),
        "uvs": mesh.uvs.astype(np.float32),
        "uv_triangles": mesh.uv_triangles.astype(np.uint16),
        "part": mesh.part,
        "part_names": np.array(mesh.part_names),
    }


def _unit_arrays(names: tuple[str, ...], offsets: Float[Array, "52 v 3"]) -> dict[str, Array]:
    """The units, each as the vertices that it moves."""
    unit, vertex = np.nonzero(np.abs(offsets).max(2) > 0)
    return {
        "unit_names": np.array(names),
        "unit_counts": np.bincount(unit, minlength=len(names)).astype(np.uint16),
        "unit_vertices": vertex.astype(np.uint16),
        "unit_offsets": offsets[unit, vertex].astype(np.float32),
    }


def _identity(
    source: MakeHuman, head: HeadCut, mesh: Mesh, regions: dict[str, Array]
) -> Float[Array, "k v 3"]:
    """The identity components at the amplitude of real heads."""
    face = regions["face"]
    hidden = regions["mouth_cavity"] + regions["eye_socket"]
    heads = sample_heads(source, head, _HEADS, np.random.default_rng(_SEED))
    heads = follow_with_scalp(heads, head, regions["scalp"], hidden)
    population = principal_modes(heads, head, 0.05 + face.astype(np.float64), _MODES)
    on_face = mesh.triangles[(face[mesh.triangles] > 0.05).all(1)]
    amplitude = find_amplitude(
        mesh.vertices,
        population.components,
        np.flatnonzero(face > 0.5),
        sample_surface(mesh.vertices, on_face),
        np.random.default_rng(_SEED),
    )
    print(
        f"identity: {_MODES} modes keep {population.variance_kept:.1%} of the variance, "
        f"{amplitude * population.residual_mm:.2f} mm left, amplitude {amplitude:.2f}"
    )
    return amplitude * population.components


def _landmark_arrays(
    mesh: Mesh, regions: dict[str, Array], brows: Float[Array, " v"], model: bytes
) -> dict[str, Array]:
    """Where the detector's landmarks are attached."""
    # The lashes are cards for a texture with alpha: opaque, they would look like thick make-up.
    seen = np.flatnonzero(mesh.part != PART_NAMES.index("lashes"))
    allowed = _outer_triangles(mesh, regions)[seen]
    found = attach(mesh.submesh(seen), paint_head(mesh, regions["lips"], brows), allowed, model)
    spread = found.spread_mm[found.attached]
    print(
        f"landmarks: {found.attached.sum()} attached, views disagree by "
        f"{np.median(spread):.2f} mm (median), {np.quantile(spread, 0.95):.2f} mm (95 %)"
    )
    return {
        "landmark_triangles": seen[found.triangles].astype(np.uint16),
        "landmark_barycentrics": found.barycentrics.astype(np.float32),
        "landmark_attached": found.attached,
    }


def _outer_triangles(mesh: Mesh, regions: dict[str, Array]) -> Bool[Array, " f"]:
    """(F,) eyeballs and the skin that is seen from outside."""
    inner = regions["mouth_cavity"] + regions["eye_socket"]
    parts = [PART_NAMES.index(name) for name in _FOR_LANDMARKS]
    return np.isin(mesh.part, parts) & (inner[mesh.triangles].max(1) == 0)
