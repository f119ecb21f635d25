"""Textures of a person's expressions: each one's photos over neutral's, eyes and teeth in common.

Eyes and teeth are half hidden in most photos. What one expression shows of them serves all others
(P02 sec. 5.2.4), as bright as the opening of lids and lips lets them be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.expressions.shading import (
    EYES,
    TEETH,
    Openings,
    Polynomial,
    brightness_at,
    fit_polynomial,
)
from mien.mesh import Mesh
from mien.model.head import NEUTRAL
from mien.texture.atlas import atlas_surface
from mien.texture.expression import ExpressionLook, look_at_expression
from mien.texture.parts import SKIN
from mien.texture.surface import SurfaceMap, parts_of

_GROUPS: Mapping[str, tuple[int, str]] = {
    "left_eyeball": (0, EYES),
    "right_eyeball": (1, EYES),
    "upper_teeth": (2, TEETH),
    "lower_teeth": (2, TEETH),
    "tongue": (2, TEETH),
}
"""The parts in the shadow of lids and lips: which opening and which polynomial is theirs."""
_MOUTH = 2
_SEEN = 0.9
_TINTS = (0.4, 1.2)
_ENOUGH = 60
"""Texels of a part that two expressions must both show for their brightness to be compared."""


@dataclass(frozen=True)
class Photographed:
    """An expression's shape and photos.

    Attributes:
        vertices: (V, 3) mm, eyes turned. cameras, photos: of those that show it.
    """

    vertices: Float[Array, "v 3"]
    cameras: Sequence[Camera]
    photos: Sequence[UInt8[Array, "h w 3"]]


@dataclass(frozen=True)
class Looks:
    """How a person looks in each expression.

    Attributes:
        textures: (H, W, 3) by expression. shading: of eyes and teeth.
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
        mesh: neutral. photographed: by expression, neutral among them.
        base: (H, W, 3) neutral's texture from all of its photos, holes filled.
    """
    height, width = base.shape[:2]
    surface = atlas_surface(mesh, width=width, height=height)
    looks = {
        name: _look(mesh.with_vertices(item.vertices), item, name, base, generic)
        for name, item in photographed.items()
    }
    openings = Openings.of(generic, mesh.vertices)
    opened = {name: openings.measure(item.vertices) for name, item in photographed.items()}
    shading = _fit_shading(surface, mesh, looks, opened)
    light = {name: brightness_at(at, shading) for name, at in opened.items()}
    common = _common_parts(surface, mesh, looks, light, base)
    textures = {}
    for name, look in looks.items():
        below = base.astype(np.float32)
        for part, (column, _) in _GROUPS.items():
            texels = parts_of(surface, mesh, part)
            below[texels] = common[texels] * light[name][column]
        textures[name] = look.over(below, surface)
    return Looks(textures, shading, {name: look.gains for name, look in looks.items()})


def _look(
    mesh: Mesh, item: Photographed, name: str, base: UInt8[Array, "h w 3"], generic: GenericHead
) -> ExpressionLook:
    height, width = base.shape[:2]
    regions = generic.regions
    several = name == NEUTRAL and len(item.cameras) > 1
    # The photos of a neutral face from several sides are blended already; one alone shows what
    # lies between lids and lips.
    within = _around_slits(generic) if several else regions["face"]
    chosen = [_most_frontal(item.cameras)] if several else range(len(item.cameras))
    return look_at_expression(
        mesh,
        [item.cameras[k] for k in chosen],
        [item.photos[k] for k in chosen],
        surface=atlas_surface(mesh, width=width, height=height),
        below=base,
        within=within,
        inside=np.maximum(regions["mouth_cavity"], regions["eye_socket"]),
    )


def _around_slits(generic: GenericHead) -> Float[Array, " v"]:
    """(V,) lips and what is inside the mouth and the eyes' sockets."""
    regions = generic.regions
    around: Array = np.maximum(
        regions["lips"], np.maximum(regions["mouth_cavity"], regions["eye_socket"])
    )
    return around


def _most_frontal(cameras: Sequence[Camera]) -> int:
    facing = [camera.center[2] / np.linalg.norm(camera.center) for camera in cameras]
    return int(np.argmax(facing))


def _fit_shading(
    surface: SurfaceMap,
    mesh: Mesh,
    looks: Mapping[str, ExpressionLook],
    opened: Mapping[str, Float[Array, " 3"]],
) -> dict[str, Polynomial]:
    """From how bright the expressions show the same texels."""
    measured: dict[str, list[tuple[float, float, float]]] = {EYES: [], TEETH: []}
    for part, (column, kind) in _GROUPS.items():
        texels = parts_of(surface, mesh, part)
        most = _by_seen(looks, texels)[-1]
        for name, look in looks.items():
            ratio = _ratio(look, looks[most], texels)
            if name != most and ratio is not None:
                pair = float(opened[name][column]), float(opened[most][column])
                measured[kind].append((*pair, ratio))
    return {kind: fit_polynomial(kind, pairs) for kind, pairs in measured.items()}


def _tint(surface: SurfaceMap, mesh: Mesh, base: UInt8[Array, "h w 3"]) -> Float[Array, " 3"]:
    """(3,) by how much the person's skin is darker or warmer than skin usually is in photos."""
    skin = base[parts_of(surface, mesh, "skin")]
    return np.clip(np.median(skin, axis=0) / np.array(SKIN.default), *_TINTS)


def _by_seen(looks: Mapping[str, ExpressionLook], texels: Bool[Array, "h w"]) -> list[str]:
    """The expressions from the one that shows least of the texels to the one that shows most."""
    return sorted(looks, key=lambda name: float(looks[name].seen[texels].sum()))


def _ratio(look: ExpressionLook, other: ExpressionLook, texels: Bool[Array, "h w"]) -> float | None:
    both = texels & (look.seen > _SEEN) & (other.seen > _SEEN)
    if np.count_nonzero(both) < _ENOUGH:
        return None
    return float(np.median(look.colours[both].mean(axis=1) / other.colours[both].mean(axis=1)))


def _common_parts(
    surface: SurfaceMap,
    mesh: Mesh,
    looks: Mapping[str, ExpressionLook],
    light: Mapping[str, Float[Array, " 3"]],
    base: UInt8[Array, "h w 3"],
) -> Float[Array, "h w 3"]:
    """(H, W, 3) eyes and teeth in full light: from the expression that shows most of each, then
    from the next, and what none shows from neutral's texture, which for teeth and tongue is a
    colour for usual light: it takes on the light that is on the skin."""
    common = base.astype(np.float32)
    tint = _tint(surface, mesh, base)
    for part, (column, _) in _GROUPS.items():
        texels = parts_of(surface, mesh, part)
        colours = common[texels] / light[NEUTRAL][column]
        if column == _MOUTH:
            colours *= tint
        for name in _by_seen(looks, texels):
            share = looks[name].share[texels][:, None]
            own = looks[name].colours[texels] / light[name][column]
            colours += share * (own - colours)
        common[texels] = colours
    return common
