"""Textures of a person's expressions: layers over neutral's texture, with common eyes and teeth.

Eyes and teeth are half hidden in most photos. What one expression shows of them is used for all
([Pighin 2002] sec. 5.2.4), shaded by the opening of lids and lips.
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
    OpeningMeter,
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
"""The parts shaded by lids and lips, with the index of their opening and their polynomial."""
_MOUTH = 2
_AROUND_MM = (4.0, 10.0)
"""Surroundings of an eye or mouth: weight 1 within the first distance, 0 beyond the second."""
_MIN_CONFIDENCE = 0.9
_TINTS = (0.4, 1.2)
_MIN_TEXELS = 60
"""Texels of a part that two expressions must both show for their brightness to be compared."""


@dataclass(frozen=True)
class ExpressionPhotos:
    """An expression's shape and photos.

    Attributes:
        vertices: (V, 3) mm, eyes turned.
        cameras: of its photos.
        photos: that show it.
    """

    vertices: Float[Array, "v 3"]
    cameras: Sequence[Camera]
    photos: Sequence[UInt8[Array, "h w 3"]]


@dataclass(frozen=True)
class ExpressionTextures:
    """The textures of all expressions.

    Attributes:
        textures: (H, W, 3) by expression.
        shading: of eyes and teeth.
        gains: (K, 3) by expression, factors on each photo's colours.
    """

    textures: dict[str, UInt8[Array, "h w 3"]]
    shading: dict[str, Polynomial]
    gains: dict[str, Float[Array, "k 3"]]


def extract_expression_textures(
    mesh: Mesh,
    photos: Mapping[str, ExpressionPhotos],
    base: UInt8[Array, "h w 3"],
    generic: GenericHead,
) -> ExpressionTextures:
    """Every expression's texture in the layout of neutral's.

    Args:
        mesh: neutral.
        photos: by expression, neutral among them.
        base: (H, W, 3) neutral's texture from all of its photos, holes filled.
        generic: its topology and regions.
    """
    height, width = base.shape[:2]
    surface = atlas_surface(mesh, width=width, height=height)
    layers = {
        name: _layer(mesh, surface, item, name, base, generic) for name, item in photos.items()
    }
    texels = {part: part_mask(surface, mesh, part) for part in _GROUPS}
    openings = OpeningMeter.of(generic, mesh.vertices)
    openings_of = {name: openings.measure(item.vertices) for name, item in photos.items()}
    shading = _fit_shading(texels, layers, openings_of)
    light = {name: brightness_at(at, shading) for name, at in openings_of.items()}
    common = _common_parts(surface, mesh, texels, layers, light, base, generic)
    textures = {}
    for name, layer in layers.items():
        below = base.astype(np.float32)
        for part, (column, _) in _GROUPS.items():
            below[texels[part]] = common[texels[part]] * light[name][column]
        textures[name] = layer.over(below, surface)
    return ExpressionTextures(
        textures, shading, {name: layer.gains for name, layer in layers.items()}
    )


def _layer(
    neutral: Mesh,
    surface: SurfaceMap,
    item: ExpressionPhotos,
    name: str,
    base: UInt8[Array, "h w 3"],
    generic: GenericHead,
) -> TextureLayer:
    mesh = neutral.with_vertices(item.vertices)
    if name != NEUTRAL:
        height, width = base.shape[:2]
        surface = atlas_surface(mesh, width=width, height=height)
    inside = np.maximum(generic.regions["mouth_cavity"], generic.regions["eye_socket"])

    def layer_of(views: Sequence[int], within: Float[Array, " v"]) -> TextureLayer:
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
        return layer_of(
            range(len(item.cameras)), np.sum(list(default_masks(generic).values()), axis=0)
        )
    # The photos of a neutral face from several sides are blended already. The inside and the
    # surroundings of each slit come from one photo: two would not agree
    # ([Pighin 2002] sec. 5.2.4).
    layers = [
        layer_of([_best_view(mesh, lines, item.cameras)], mask)
        for lines, mask in _slits(mesh, generic)
    ]
    return reduce(TextureLayer.merged_with, layers)


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
    """The photo that shows the vertices largest and most frontally."""
    points, normals = mesh.vertices[around], mesh.vertex_normals()[around]

    def quality(camera: Camera) -> float:
        towards = camera.center - points
        distance = np.linalg.norm(towards, axis=1)
        facing = np.einsum("vc,vc->v", towards, normals) / distance
        return float(np.mean(np.maximum(facing, 0) * camera.focal_px / distance))

    return int(np.argmax([quality(camera) for camera in cameras]))


def _fit_shading(
    texels: Mapping[str, Bool[Array, "h w"]],
    layers: Mapping[str, TextureLayer],
    openings_of: Mapping[str, Float[Array, " 3"]],
) -> dict[str, Polynomial]:
    """Fitted to the brightness of the same texels in different expressions."""
    measured: dict[str, list[tuple[float, float, float]]] = {EYES: [], TEETH: []}
    for part, (column, kind) in _GROUPS.items():
        reference = _by_coverage(layers, texels[part])[-1]
        for name, layer in layers.items():
            ratio = _brightness_ratio(layer, layers[reference], texels[part])
            if name != reference and ratio is not None:
                pair = (
                    float(openings_of[name][column]),
                    float(openings_of[reference][column]),
                )
                measured[kind].append((*pair, ratio))
    return {kind: fit_polynomial(kind, pairs) for kind, pairs in measured.items()}


def _tint(surface: SurfaceMap, mesh: Mesh, base: UInt8[Array, "h w 3"]) -> Float[Array, " 3"]:
    """(3,) ratio of the person's skin colour to the default one."""
    skin = base[part_mask(surface, mesh, "skin")]
    return np.clip(np.median(skin, axis=0) / np.array(SKIN.default), *_TINTS)


def _by_coverage(layers: Mapping[str, TextureLayer], texels: Bool[Array, "h w"]) -> list[str]:
    """The expressions by how much of the texels they show, ascending."""
    return sorted(layers, key=lambda name: float(layers[name].confidence[texels].sum()))


def _brightness_ratio(
    layer: TextureLayer, other: TextureLayer, texels: Bool[Array, "h w"]
) -> float | None:
    both = texels & (layer.confidence > _MIN_CONFIDENCE) & (other.confidence > _MIN_CONFIDENCE)
    if np.count_nonzero(both) < _MIN_TEXELS:
        return None
    here, there = (np.maximum(item.colours[both].mean(axis=1), 1.0) for item in (layer, other))
    return float(np.median(here / there))


def _common_parts(
    surface: SurfaceMap,
    mesh: Mesh,
    texels: Mapping[str, Bool[Array, "h w"]],
    layers: Mapping[str, TextureLayer],
    light: Mapping[str, Float[Array, " 3"]],
    base: UInt8[Array, "h w 3"],
    generic: GenericHead,
) -> Float[Array, "h w 3"]:
    """(H, W, 3) eyes and teeth in full light, from the expression that shows most of each first.

    Texels that none shows have neutral's colours, or default ones in the light of the skin.
    """
    common = base.astype(np.float32)
    tint = _tint(surface, mesh, base)
    points = interpolate_vertex_values(surface, mesh, generic.mesh.vertices)
    for part, (column, _) in _GROUPS.items():
        inside = texels[part]
        colours = common[inside] / light[NEUTRAL][column]
        if part.endswith("teeth"):
            colours = default_teeth_colours(points[inside], part)
        if column == _MOUTH:
            colours *= tint
        for name in _by_coverage(layers, inside):
            opacity = layers[name].opacity[inside][:, None]
            own = layers[name].colours[inside] / light[name][column]
            colours += opacity * (own - colours)
        common[inside] = colours
    return common
