"""Textures of a person's expressions: each one's photos over neutral's, eyes and teeth in common.

Eyes and teeth are half hidden in most photos. What one expression shows of them serves all others
([Pighin 2002] sec. 5.2.4), as bright as the opening of lids and lips lets them be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.head import NEUTRAL
from mien.mesh import Mesh
from mien.rig.regions import default_masks
from mien.rig.shading import (
    EYES,
    TEETH,
    Openings,
    Polynomial,
    brightness_at,
    fit_polynomial,
)
from mien.texture.atlas import atlas_surface
from mien.texture.expression import TextureLayer, extract_expression_layer
from mien.texture.parts import SKIN
from mien.texture.surface import SurfaceMap, interpolate_vertex_values, part_mask
from mien.texture.teeth import default_teeth_colours

_GROUPS: Mapping[str, tuple[int, str]] = {
    "left_eyeball": (0, EYES),
    "right_eyeball": (1, EYES),
    "upper_teeth": (2, TEETH),
    "lower_teeth": (2, TEETH),
    "tongue": (2, TEETH),
}
"""The parts in the shadow of lids and lips: which opening and which polynomial is theirs."""
_MOUTH = 2
_AROUND_MM = (4.0, 10.0)
"""What belongs to an eye or a mouth: all within the first distance, nothing beyond the second."""
_SEEN = 0.9
_TINTS = (0.4, 1.2)
_ENOUGH = 60
"""Texels of a part that two expressions must both show for their brightness to be compared."""


@dataclass(frozen=True)
class Photographed:
    """An expression's shape and photos.

    Attributes:
        vertices: (V, 3) mm, eyes turned.
        cameras: of those that show it.
        photos: of those that show it.
    """

    vertices: Float[Array, "v 3"]
    cameras: Sequence[Camera]
    photos: Sequence[UInt8[Array, "h w 3"]]


@dataclass(frozen=True)
class Looks:
    """How a person looks in each expression.

    Attributes:
        textures: (H, W, 3) by expression.
        shading: of eyes and teeth.
        gains: (K, 3) by expression, what each photo's colours were multiplied by.
    """

    textures: dict[str, UInt8[Array, "h w 3"]]
    shading: dict[str, Polynomial]
    gains: dict[str, Float[Array, "k 3"]]


def paint_expressions(
    mesh: Mesh,
    photographed: Mapping[str, Photographed],
    base: UInt8[Array, "h w 3"],
    generic: GenericHead,
) -> Looks:
    """Every expression's texture in the layout of neutral's.

    Args:
        mesh: neutral.
        photographed: by expression, neutral among them.
        base: (H, W, 3) neutral's texture from all of its photos, holes filled.
    """
    height, width = base.shape[:2]
    surface = atlas_surface(mesh, width=width, height=height)
    looks = {
        name: _look(mesh, surface, item, name, base, generic) for name, item in photographed.items()
    }
    texels = {part: part_mask(surface, mesh, part) for part in _GROUPS}
    openings = Openings.of(generic, mesh.vertices)
    opened = {name: openings.measure(item.vertices) for name, item in photographed.items()}
    shading = _fit_shading(texels, looks, opened)
    light = {name: brightness_at(at, shading) for name, at in opened.items()}
    common = _common_parts(surface, mesh, texels, looks, light, base, generic)
    textures = {}
    for name, look in looks.items():
        below = base.astype(np.float32)
        for part, (column, _) in _GROUPS.items():
            below[texels[part]] = common[texels[part]] * light[name][column]
        textures[name] = look.over(below, surface)
    return Looks(textures, shading, {name: look.gains for name, look in looks.items()})


def _look(
    neutral: Mesh,
    surface: SurfaceMap,
    item: Photographed,
    name: str,
    base: UInt8[Array, "h w 3"],
    generic: GenericHead,
) -> TextureLayer:
    mesh = neutral.with_vertices(item.vertices)
    if name != NEUTRAL:
        height, width = base.shape[:2]
        surface = atlas_surface(mesh, width=width, height=height)
    inside = np.maximum(generic.regions["mouth_cavity"], generic.regions["eye_socket"])

    def seen_by(views: Sequence[int], within: Float[Array, " v"]) -> TextureLayer:
        return extract_expression_layer(
            mesh,
            [item.cameras[k] for k in views],
            [item.photos[k] for k in views],
            surface=surface,
            below=base,
            within=within,
            inside=inside,
        )

    if name != NEUTRAL or len(item.cameras) == 1:
        return seen_by(
            range(len(item.cameras)), np.sum(list(default_masks(generic).values()), axis=0)
        )
    # The photos of a neutral face from several sides are blended already. What lies between and
    # around lids and lips comes from one photo for each: two would not agree
    # ([Pighin 2002] sec. 5.2.4).
    looks = [
        seen_by([_best_view(mesh, lines, item.cameras)], mask)
        for lines, mask in _slits(mesh, generic)
    ]
    return reduce(TextureLayer.merged_with, looks)


def _slits(mesh: Mesh, generic: GenericHead) -> list[tuple[Int[Array, " n"], Float[Array, " v"]]]:
    """Vertices along each eye's lids and along the lips, and (V,) masks of their surroundings."""
    from scipy.spatial import cKDTree

    masks = default_masks(generic)
    regions = {
        ("left_upper_eyelid", "left_lower_eyelid"): masks["left_eye"],
        ("right_upper_eyelid", "right_lower_eyelid"): masks["right_eye"],
        ("upper_lip_inner", "lower_lip_inner"): masks["left_mouth"] + masks["right_mouth"],
    }
    slits = []
    for names, mask in regions.items():
        lines = np.array([vertex for name in names for vertex in generic.polylines[name]])
        distance = cKDTree(mesh.vertices[lines]).query(mesh.vertices)[0]
        near = np.clip((_AROUND_MM[1] - distance) / (_AROUND_MM[1] - _AROUND_MM[0]), 0, 1)
        slits.append((lines, near * mask))
    return slits


def _best_view(mesh: Mesh, around: Int[Array, " n"], cameras: Sequence[Camera]) -> int:
    """The photo that shows the vertices largest and most squarely."""
    places, normals = mesh.vertices[around], mesh.vertex_normals()[around]

    def quality(camera: Camera) -> float:
        towards = camera.center - places
        distance = np.linalg.norm(towards, axis=1)
        facing = np.einsum("vc,vc->v", towards, normals) / distance
        return float(np.mean(np.maximum(facing, 0) * camera.focal_px / distance))

    return int(np.argmax([quality(camera) for camera in cameras]))


def _fit_shading(
    texels: Mapping[str, Bool[Array, "h w"]],
    looks: Mapping[str, TextureLayer],
    opened: Mapping[str, Float[Array, " 3"]],
) -> dict[str, Polynomial]:
    """From how bright the expressions show the same texels."""
    measured: dict[str, list[tuple[float, float, float]]] = {EYES: [], TEETH: []}
    for part, (column, kind) in _GROUPS.items():
        most = _by_seen(looks, texels[part])[-1]
        for name, look in looks.items():
            ratio = _ratio(look, looks[most], texels[part])
            if name != most and ratio is not None:
                pair = float(opened[name][column]), float(opened[most][column])
                measured[kind].append((*pair, ratio))
    return {kind: fit_polynomial(kind, pairs) for kind, pairs in measured.items()}


def _tint(surface: SurfaceMap, mesh: Mesh, base: UInt8[Array, "h w 3"]) -> Float[Array, " 3"]:
    """(3,) by how much the person's skin is darker or warmer than skin usually is in photos."""
    skin = base[part_mask(surface, mesh, "skin")]
    return np.clip(np.median(skin, axis=0) / np.array(SKIN.default), *_TINTS)


def _by_seen(looks: Mapping[str, TextureLayer], texels: Bool[Array, "h w"]) -> list[str]:
    """The expressions from the one that shows least of the texels to the one that shows most."""
    return sorted(looks, key=lambda name: float(looks[name].confidence[texels].sum()))


def _ratio(look: TextureLayer, other: TextureLayer, texels: Bool[Array, "h w"]) -> float | None:
    both = texels & (look.confidence > _SEEN) & (other.confidence > _SEEN)
    if np.count_nonzero(both) < _ENOUGH:
        return None
    here, there = (np.maximum(item.colours[both].mean(axis=1), 1.0) for item in (look, other))
    return float(np.median(here / there))


def _common_parts(
    surface: SurfaceMap,
    mesh: Mesh,
    texels: Mapping[str, Bool[Array, "h w"]],
    looks: Mapping[str, TextureLayer],
    light: Mapping[str, Float[Array, " 3"]],
    base: UInt8[Array, "h w 3"],
    generic: GenericHead,
) -> Float[Array, "h w 3"]:
    """(H, W, 3) eyes and teeth in full light: from the expression that shows most of each, then

    from the next. What none shows has neutral's colours, or usual ones, which take on the light
    that is on the skin.
    """
    common = base.astype(np.float32)
    tint = _tint(surface, mesh, base)
    places = interpolate_vertex_values(surface, mesh, generic.mesh.vertices)
    for part, (column, _) in _GROUPS.items():
        inside = texels[part]
        colours = common[inside] / light[NEUTRAL][column]
        if part.endswith("teeth"):
            colours = default_teeth_colours(places[inside], part)
        if column == _MOUTH:
            colours *= tint
        for name in _by_seen(looks, inside):
            share = looks[name].opacity[inside][:, None]
            own = looks[name].colours[inside] / light[name][column]
            colours += share * (own - colours)
        common[inside] = colours
    return common
