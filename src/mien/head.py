"""The head that `mien build` makes and every later stage reads."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Literal

import numpy as np

from mien.arrays import Array, Float, UInt8, check_array, check_image, frozen
from mien.camera import Camera
from mien.errors import InputError
from mien.expression_names import is_plain_name
from mien.mesh import Mesh

NEUTRAL = "neutral"
ATLAS = "atlas"
CYLINDER = "cylinder"
SHADING = {"eyes": (0.62, 0.52, -0.14), "teeth": (0.45, 3.0, -4.0)}
"""Brightness of eyes and teeth as photographs usually have it: c0 + c1 o + c2 o^2, o being the gap
between the lids over neutral's, or that between the lips over the mouth's width."""


Grade = Literal["good", "fair", "poor"]
GRADES: tuple[Grade, ...] = ("good", "fair", "poor")


@dataclass(frozen=True)
class Verdict:
    """How far a head is to be believed.

    Attributes:
        grade: "good": measured from several sides; "fair": what photos leave open comes from the
            prior of faces; "poor": the photos contradict each other, or what people look like.
        reasons: why it is no better, in plain sentences.
    """

    grade: Grade
    reasons: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.grade not in GRADES:
            raise InputError("grade", " or ".join(GRADES), self.grade)

    def __str__(self) -> str:
        return f"{self.grade} ({'; '.join(self.reasons)})" if self.reasons else self.grade


@dataclass(frozen=True)
class FittedView:
    """One photo and the camera that was estimated for it.

    Attributes:
        photo: the photo's name, relative to the folder that was built, with forward slashes.
        camera: in the pixels of the photo after EXIF orientation.
        rms_px: root mean square reprojection error of the points used.
        points_used: number of inliers, points of this photo that determine camera and shape.
        outliers: the reason by point name for every point that was not used.
        gains: (3,) factors of its colours in the texture, which equalize the photos' exposure.

    Raises:
        InputError: an error that is negative or not finite, a negative count.
    """

    photo: str
    camera: Camera
    rms_px: float
    points_used: int
    outliers: dict[str, str] = field(default_factory=dict)
    gains: Float[Array, " 3"] = field(default_factory=lambda: np.ones(3))

    def __post_init__(self) -> None:
        gains = check_array("gains", self.gains, (3,))
        if gains.min() <= 0:
            raise InputError("gains", "numbers above 0", gains.min())
        object.__setattr__(self, "gains", frozen(gains))
        if not (np.isfinite(self.rms_px) and self.rms_px >= 0):
            raise InputError("rms_px", "a number from 0 up", self.rms_px)
        if self.points_used < 0:
            raise InputError("points_used", "a count from 0 up", self.points_used)


@dataclass(frozen=True)
class Expression:
    """The head's shape in one photographed expression.

    Attributes:
        vertices: (V, 3) mm, head space.
        views: the photos it was fitted to.
        texture: name of its texture among the head's, in the mesh's own coordinates.
        units: weights of the face units that approximate it.
        gaze: (2, 2) radians, yaw to the subject's left and pitch up of the left and the right eye,
            from neutral's direction. The vertices include it.
    """

    vertices: Float[Array, "v 3"]
    views: tuple[FittedView, ...] = ()
    texture: str = ATLAS
    units: dict[str, float] = field(default_factory=dict)
    gaze: Float[Array, "2 2"] = field(default_factory=lambda: np.zeros((2, 2)))

    def __post_init__(self) -> None:
        vertices = check_array("vertices", self.vertices, (None, 3))
        object.__setattr__(self, "vertices", frozen(vertices))
        object.__setattr__(self, "gaze", frozen(check_array("gaze", self.gaze, (2, 2))))
        for name, weight in self.units.items():
            if not np.isfinite(weight):
                raise InputError(f"units.{name}", "a finite number", weight)


@dataclass(frozen=True)
class Head:
    """A textured head of one person, with its photographed expressions and its face units.

    Attributes:
        subject: the person's name, as the user calls them.
        mesh: the generic topology over the neutral shape; `mesh.vertices` is neutral's.
        expressions: by name; "neutral" is always among them.
        uncertainty_mm: (V,) expected error of each vertex of the neutral shape.
        unit_names: the face units this head has (ARKit's 52 names).
        unit_offsets: (K, V, 3) mm, added to the neutral vertices at weight 1.
        textures: (h, w, 3) sRGB by name. "atlas" lies in the mesh's own texture coordinates;
            "cylinder" is [Pighin 2002]'s map (sec. 5.2.1).
        regions: (V,) in [0, 1], soft masks of the regions of the face that can be controlled
            separately, by name; empty takes the generic head's (rig.regions).
        shading: coefficients of the brightness of "eyes" and "teeth" by how far lids and lips are
            open ([Pighin 2002] sec. 5.2.4).
        left_out: the reason by photo name for every photo that did not fit.
        verdict: how far it is to be believed; None in heads of older versions.
        generator: the program that made it.

    Raises:
        InputError: shapes that do not fit, no neutral, a name that makes no file name.
    """

    subject: str
    mesh: Mesh
    expressions: dict[str, Expression]
    uncertainty_mm: Float[Array, " v"]
    unit_names: tuple[str, ...] = ()
    unit_offsets: Float[Array, "k v 3"] | None = None
    textures: dict[str, UInt8[Array, "h w 3"]] = field(default_factory=dict)
    regions: dict[str, Float[Array, " v"]] = field(default_factory=dict)
    shading: dict[str, tuple[float, float, float]] = field(default_factory=lambda: dict(SHADING))
    left_out: dict[str, str] = field(default_factory=dict)
    verdict: Verdict | None = None
    generator: str = field(default_factory=lambda: f"mien {version('mien')}")

    def __post_init__(self) -> None:
        shape = self.mesh.vertices.shape
        _check_expressions(self.expressions, self.mesh)
        for name, weights in self.shading.items():
            check_array(f"shading.{name}", weights, (3,))
        if set(self.shading) != set(SHADING):
            raise InputError("shading", " and ".join(SHADING), ", ".join(self.shading) or "nothing")
        regions = {
            name: frozen(check_array(f"region {name}", mask, shape[:1]))
            for name, mask in self.regions.items()
        }
        textures = {}
        for name, pixels in self.textures.items():
            _check_name("textures", name)
            textures[name] = frozen(check_image(f"texture {name}", pixels))
        offsets = np.zeros((0, *shape)) if self.unit_offsets is None else self.unit_offsets
        offsets = check_array("unit_offsets", offsets, (len(self.unit_names), *shape))
        uncertainty = check_array("uncertainty_mm", self.uncertainty_mm, shape[:1])
        object.__setattr__(self, "regions", regions)
        object.__setattr__(self, "textures", textures)
        object.__setattr__(self, "unit_offsets", frozen(offsets))
        object.__setattr__(self, "uncertainty_mm", frozen(uncertainty))

    @property
    def units(self) -> Float[Array, "k v 3"]:
        """(K, V, 3) mm: unit_offsets; never None."""
        assert self.unit_offsets is not None
        return self.unit_offsets

    @property
    def views(self) -> tuple[FittedView, ...]:
        """The fitted photos of all expressions, in their order."""
        return tuple(view for item in self.expressions.values() for view in item.views)

    def view(self, photo: str) -> FittedView:
        """The fitted view of this photo. Raises: InputError: no such photo was fitted."""
        for view in self.views:
            if view.photo == photo:
                return view
        known = ", ".join(view.photo for view in self.views) or "no photo at all"
        raise InputError("photo", f"one of the head's photos ({known})", photo)

    def expression_mesh(self, name: str) -> Mesh:
        """The mesh in a photographed expression. Raises: InputError: the head has none such."""
        if name not in self.expressions:
            raise InputError("expression", f"one of {', '.join(self.expressions)}", name)
        return self.mesh.with_vertices(self.expressions[name].vertices)


def _check_expressions(expressions: dict[str, Expression], mesh: Mesh) -> None:
    if NEUTRAL not in expressions:
        raise InputError("expressions", "one called neutral", ", ".join(expressions) or "none")
    for name, expression in expressions.items():
        _check_name("expressions", name)
        check_array(f"expression {name}", expression.vertices, mesh.vertices.shape)
    if not np.array_equal(expressions[NEUTRAL].vertices, mesh.vertices):
        raise InputError("mesh", "the vertices of the neutral expression", "others")


def _check_name(where: str, name: str) -> None:
    """Names become file names and archive members, so they must be plain ones."""
    if not is_plain_name(name):
        raise InputError(where, "names that can be file names", repr(name))
