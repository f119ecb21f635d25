"""A head that can be moved: photographed expressions, face units and gaze to one posed face."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.errors import InputError
from mien.expressions.basis import WEIGHT_RANGE, check_weights, outside_hull
from mien.expressions.contacts import Mechanics
from mien.expressions.explained import Explanations
from mien.expressions.followers import part_vertices
from mien.expressions.regions import AROUND, MASKS, check_masks, default_masks
from mien.expressions.shading import Openings, brightness_at
from mien.expressions.state import FACE, FaceState, PosedFace
from mien.model.head import NEUTRAL, Head


class Rig:
    """Poses the face of one head; everything that does not change is prepared once.

    Attributes:
        names: photographed expressions, neutral first: what the weights' columns stand for.
        textures: (h, w, 3) one for each name, of one size.
        offsets: (K, V, 3) mm from neutral to each of them, eyeballs where neutral has them.
    Raises: InputError: a head of another topology than the generic one's, no texture for neutral,
        textures of different sizes.
    Source: P02 sec. 6.1.1: consensus geometry, weights by region. Units, contacts and what of an
        expression comes along with the units that explain it are ours (docs/expressions.md).
    """

    def __init__(self, head: Head) -> None:
        generic = load_generic_head()
        if head.mesh.vertices.shape != generic.mesh.vertices.shape:
            expected = f"the generic head's {len(generic.mesh.vertices)} vertices"
            raise InputError("head", expected, len(head.mesh.vertices))
        self.names = (NEUTRAL, *(name for name in head.expressions if name != NEUTRAL))
        self.textures = _textures(head, self.names)
        self.unit_names = head.unit_names
        self._neutral = np.asarray(head.mesh.vertices, np.float64)
        self._units = np.asarray(head.units, np.float64)
        masks = check_masks(head.regions or default_masks(generic), len(self._neutral))
        self._masks = np.stack([masks[name] for name in MASKS], axis=1)
        self._rest = 1 - self._masks.sum(axis=1)
        expressions = [head.expressions[name] for name in self.names]
        self._gaze = np.stack([item.gaze for item in expressions])
        self._mechanics = Mechanics.of(generic, self._neutral, self._units)
        self.offsets = np.stack(
            [self._still_eyes(item.vertices) - self._neutral for item in expressions]
        )
        self._explained = Explanations.of(
            np.array([[item.units.get(n, 0.0) for n in self.unit_names] for item in expressions]),
            self._units,
            self.offsets,
            self._masks,
        )
        self._openings = Openings.of(generic, self._neutral)
        self._shading = head.shading
        self._photographed = np.stack([item.vertices for item in expressions])
        openings = np.stack([self._openings.measure(item) for item in self._photographed])
        self._photographed_light = brightness_at(openings, self._shading)
        self._shaded = _shaded_parts(generic)
        # Where eyes look in a photograph has nothing to do with the units that it shows.
        self._skin = np.ones(len(self._neutral))
        for eyeball in self._mechanics.look.eyeballs:
            self._skin[eyeball.vertices] = 0

    def evaluate(self, state: FaceState, *, contacts: bool = True) -> PosedFace:
        """The face in this state.

        One expression at weight 1 is that expression exactly, as photographed.

        Args:
            contacts: whether lids ride on the eyes and lips do not pass through each other.
        Raises: InputError: an unknown region, expression or unit; weights outside [-0.5, 1.5].
        """
        by_region = self._region_weights(state.expressions)
        units = self._unit_weights(state.units)
        linear = self._neutral + np.tensordot(units, self._units, axes=1)
        driven = self._explained.driven(units) * np.clip(by_region[:, :1], 0, 1)
        weights = self._spread(by_region)
        vertices = linear + np.einsum("vk,kvc->vc", weights, self.offsets)
        vertices = self._turned_eyes(vertices, weights)
        if driven.any():
            along = self._spread(driven) * self._skin[:, None]
            vertices += self._explained.residuals(along)
            weights = weights + np.column_stack([-along.sum(axis=1), along])
        moved = bool(units.any() or state.gaze.yaw or state.gaze.pitch)
        if not moved and _one_expression(by_region):
            vertices = self._photographed[int(by_region[0].argmax())]
        else:
            vertices = self._mechanics.applied(vertices, state.units, state.gaze, contacts=contacts)
        return PosedFace(vertices, weights, self._brightness(vertices, weights))

    def mask(self, region: str) -> Float[Array, " v"]:
        """(V,) in [0, 1]: how far each vertex obeys this region's weights.

        Raises: InputError: an unknown region.
        """
        _check_known("region", region, AROUND)
        inside = [region in (name, *AROUND[name]) for name in MASKS]
        mask: Array = self._masks[:, inside].sum(axis=1)
        return mask + self._rest if region == FACE else mask

    def hull_notes(self, state: FaceState) -> tuple[str, ...]:
        """What a state asks for beyond the expressions that were photographed, by its regions.

        Raises: InputError: as evaluate, for expressions and their weights.
        """
        self._region_weights(state.expressions)
        weights = {region: self._weights(given) for region, given in state.expressions.items()}
        notes = {region: outside_hull(row, self.names) for region, row in weights.items()}
        return tuple(f"{region}: {note}" for region, note in notes.items() if note)

    def _region_weights(
        self, expressions: Mapping[str, Mapping[str, float]]
    ) -> Float[Array, "r k"]:
        """(R, K) weights in each mask's region, and in the rest of the head last."""
        for region in expressions:
            _check_known("region", region, AROUND)
        rows = []
        for region in (*MASKS, FACE):
            names = (region, *AROUND[region])
            rows.append(
                self._weights(next((expressions[n] for n in names if n in expressions), {}))
            )
        return np.array(rows)

    def _weights(self, given: Mapping[str, float]) -> Float[Array, " k"]:
        weights = np.zeros(len(self.names))
        for name, weight in given.items():
            _check_known("expression", name, self.names)
            weights[self.names.index(name)] = weight
        if NEUTRAL not in given:
            weights[0] = 1 - weights.sum()
        low, high = WEIGHT_RANGE
        for name in (*given, NEUTRAL):
            weight = weights[self.names.index(name)]
            if not low - 1e-6 <= weight <= high + 1e-6:
                raise InputError(f"weight of {name}", f"{low} to {high}", f"{weight:g}")
        return check_weights(weights)

    def _unit_weights(self, given: Mapping[str, float]) -> Float[Array, " u"]:
        weights = np.zeros(len(self.unit_names))
        for name, weight in given.items():
            _check_known("unit", name, self.unit_names)
            if not np.isfinite(weight):
                raise InputError(f"unit {name}", "a finite number", weight)
            weights[self.unit_names.index(name)] = weight
        return weights

    def _spread(self, by_region: Float[Array, "r k"]) -> Float[Array, "v k"]:
        """Regions' weights at the vertices."""
        spread: Array = self._masks @ by_region[:-1] + self._rest[:, None] * by_region[-1]
        return spread

    def _still_eyes(self, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3"]:
        """The expression with its eyeballs as in neutral: they are turned, not mixed."""
        still = np.array(vertices, np.float64)
        for eyeball in self._mechanics.look.eyeballs:
            still[eyeball.vertices] = self._neutral[eyeball.vertices]
        return still

    def _turned_eyes(
        self, vertices: Float[Array, "v 3"], weights: Float[Array, "v k"]
    ) -> Float[Array, "v 3"]:
        for side, eyeball in enumerate(self._mechanics.look.eyeballs):
            ball = eyeball.vertices
            yaw, pitch = weights[ball[0]] @ self._gaze[:, side]
            if yaw or pitch:
                vertices[ball] = eyeball.turned(vertices[ball], float(yaw), float(pitch))
        return vertices

    def _brightness(
        self, vertices: Float[Array, "v 3"], weights: Float[Array, "v k"]
    ) -> Float[Array, " v"]:
        """P02 sec. 5.2.4, over the shadow that is in the mixed textures already."""
        now = brightness_at(self._openings.measure(vertices), self._shading)
        brightness = np.ones(len(vertices))
        for column, part in enumerate(self._shaded):
            there = weights[part[0]] @ self._photographed_light[:, column]
            brightness[part] = now[column] / max(float(there), 0.1)
        return brightness


def _textures(head: Head, names: Iterable[str]) -> tuple[UInt8[Array, "h w 3"], ...]:
    """One for each expression; neutral's for one that has none."""
    own = {name: head.textures.get(head.expressions[name].texture) for name in names}
    neutral = own[NEUTRAL]
    if neutral is None:
        raise InputError("head", "a texture of neutral", ", ".join(head.textures) or "none")
    for name, texture in own.items():
        if texture is not None and texture.shape != neutral.shape:
            expected = f"{neutral.shape[1]}x{neutral.shape[0]} as neutral's"
            found = f"{texture.shape[1]}x{texture.shape[0]}"
            raise InputError(f"texture of {name}", expected, found)
    return tuple(neutral if texture is None else texture for texture in own.values())


def _shaded_parts(generic: GenericHead) -> tuple[Array, Array, Array]:
    """Vertices of the left eye, the right eye, and of teeth and tongue."""
    return (
        part_vertices(generic, "left_eyeball"),
        part_vertices(generic, "right_eyeball"),
        part_vertices(generic, "upper_teeth", "lower_teeth", "tongue"),
    )


def _one_expression(by_region: Float[Array, "r k"]) -> bool:
    """Whether the face is one photographed expression, everywhere the same."""
    return bool((by_region == by_region[0]).all() and np.count_nonzero(by_region[0]) == 1)


def _check_known(what: str, name: str, known: Iterable[str]) -> None:
    known = tuple(known)
    if name not in known:
        close = difflib.get_close_matches(name, known, n=3) or known[:6]
        raise InputError(what, f"one of the head's, such as {', '.join(close)}", name)
