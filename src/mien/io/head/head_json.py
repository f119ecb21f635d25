"""`head.json`: everything about a head that is not an array or a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mien.arrays import Array
from mien.camera import Camera
from mien.errors import DocumentError, InputError
from mien.head import SHADING, FittedView, Head
from mien.limits import MAX_PHOTO_SIDE, UNIT_RANGE
from mien.reading.names import is_inside
from mien.reading.strict_json import (
    DocumentFormat,
    as_array,
    as_choice,
    as_list,
    as_number,
    as_object,
    as_text,
    as_whole,
    join,
    need,
)

HEAD_FORMAT = DocumentFormat("mien head", 1)

UNITS = {
    "length": "mm",
    "axes": "x to the subject's left, y up, z out of the face",
    "pixels": "origin at the top-left corner, centre of the first pixel at (0.5, 0.5)",
}
"""What the numbers of a head folder mean."""

_EYES, _AXES = ("left", "right"), ("yaw", "pitch")

Json = dict[str, Any]


def head_to_json(head: Head, photo_files: Mapping[str, str]) -> Json:
    """The contents of head.json.

    Args:
        head: the head.
        photo_files: where in the folder each photo's pixels are, by the photo's name.
    """
    return {
        **HEAD_FORMAT.header,
        "generator": head.generator,
        "subject": head.subject,
        "units": dict(UNITS),
        "parts": list(head.mesh.part_names),
        "expressions": {
            name: {
                "texture": expression.texture,
                "units": {unit: float(weight) for unit, weight in expression.units.items()},
                "gaze_rad": {
                    eye: {"yaw": float(yaw), "pitch": float(pitch)}
                    for eye, (yaw, pitch) in zip(_EYES, expression.gaze, strict=True)
                },
                "cameras": [_view_to_json(view) for view in expression.views],
            }
            for name, expression in head.expressions.items()
        },
        "textures": {name: f"textures/{name}.png" for name in head.textures},
        "photos": dict(photo_files),
        "shading": {part: list(terms) for part, terms in head.shading.items()},
        "left_out": dict(head.left_out),
        "face_units": list(head.unit_names),
    }


def check_head_format(data: Json) -> None:
    """Raises: DocumentError: not a head's, from a newer version of mien, in other units."""
    HEAD_FORMAT.check(data)
    units = as_object(need(data, "units", ""), "units")
    for name, expected in UNITS.items():
        as_choice(need(units, name, "units"), f"units.{name}", name, (expected,))


def texts_from_json(data: Json, key: str, place: str = "") -> dict[str, str]:
    """data[key], an object whose values are text. Raises: DocumentError."""
    texts = as_object(need(data, key, place), join(place, key))
    return {name: as_text(text, join(join(place, key), name)) for name, text in texts.items()}


def texture_paths(data: Json) -> dict[str, str]:
    """Path of each texture within the folder. Raises: DocumentError: one outside of it."""
    files = texts_from_json(data, "textures")
    for name, path in files.items():
        if not is_inside(path):
            found = f"found {path[:60]!r}"
            raise DocumentError(
                join("textures", name), f"expected a path inside the folder, {found}"
            )
    return files


def views_from_json(data: Json, place: str) -> tuple[FittedView, ...]:
    """The cameras of the expression at a place. Raises: DocumentError."""
    place = f"{place}.cameras"
    return tuple(
        _view_from_json(as_object(item, f"{place}[{i}]"), f"{place}[{i}]")
        for i, item in enumerate(as_list(need(data, "cameras", place[:-8]), place))
    )


def units_and_gaze_from_json(data: Json, place: str) -> Json:
    """Units and gaze of an expression, as fields of head.Expression. Raises: DocumentError.

    Heads of older versions of mien have none.
    """
    units = as_object(data.get("units", {}), f"{place}.units")
    low, high = UNIT_RANGE
    weights = {
        name: as_number(weight, join(f"{place}.units", name), least=low, most=high)
        for name, weight in units.items()
    }
    if "gaze_rad" not in data:
        return {"units": weights}
    place = f"{place}.gaze_rad"
    gaze = as_object(data["gaze_rad"], place)
    eyes = [
        (as_object(need(gaze, eye, place), join(place, eye)), join(place, eye)) for eye in _EYES
    ]
    angles = [
        [
            as_number(need(item, axis, at), join(at, axis), least=-np.pi, most=np.pi)
            for axis in _AXES
        ]
        for item, at in eyes
    ]
    return {"units": weights, "gaze": np.array(angles)}


def shading_from_json(data: Json) -> dict[str, tuple[float, float, float]]:
    """Coefficients by part, SHADING where there are none. Raises: DocumentError."""
    if "shading" not in data:
        return dict(SHADING)
    shading = as_object(data["shading"], "shading", SHADING)
    terms = {
        part: as_array(need(shading, part, "shading"), f"shading.{part}", (3,)).tolist()
        for part in SHADING
    }
    return {part: (c0, c1, c2) for part, (c0, c1, c2) in terms.items()}


def _view_to_json(view: FittedView) -> Json:
    camera = view.camera
    return {
        "photo": view.photo,
        "width": camera.width,
        "height": camera.height,
        "focal_px": camera.focal_px,
        "principal_px": camera.principal.tolist(),
        "R_cam_head": camera.R_cam_head.tolist(),
        "t_cam_head_mm": camera.t_cam_head.tolist(),
        "rms_px": float(view.rms_px),
        "points_used": int(view.points_used),
        "distrusted": dict(view.outliers),
        "gains": view.gains.tolist(),
    }


def _view_from_json(item: Json, place: str) -> FittedView:
    def numbers(key: str, *shape: int) -> Array:
        return as_array(need(item, key, place), f"{place}.{key}", shape)

    def side(key: str) -> int:
        return as_whole(need(item, key, place), f"{place}.{key}", above=0, most=MAX_PHOTO_SIDE)

    try:
        camera = Camera(
            width=side("width"),
            height=side("height"),
            focal_px=as_number(need(item, "focal_px", place), f"{place}.focal_px", above=0),
            R_cam_head=numbers("R_cam_head", 3, 3),
            t_cam_head=numbers("t_cam_head_mm", 3),
            principal_px=numbers("principal_px", 2),
        )
        return FittedView(
            photo=as_text(need(item, "photo", place), f"{place}.photo"),
            camera=camera,
            rms_px=as_number(need(item, "rms_px", place), f"{place}.rms_px", least=0),
            points_used=as_whole(need(item, "points_used", place), f"{place}.points_used", least=0),
            outliers=texts_from_json(item, "distrusted", place),
            gains=numbers("gains", 3) if "gains" in item else np.ones(3),
        )
    except InputError as error:
        problem = f"expected {error.expected}, found {error.got}"
        raise DocumentError(f"{place}.{error.name}", problem) from None
