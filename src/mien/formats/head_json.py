"""`head.json`: everything about a head that is not an array or a picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any, TypeVar

import numpy as np

from mien.arrays import Array, check_array
from mien.camera import Camera
from mien.errors import Broken
from mien.model.head import SHADING, FittedView, Head

FORMAT = "mien head"
VERSION = 1

_EYES = ("left", "right")

Json = dict[str, Any]
Kind = TypeVar("Kind")


def head_to_json(head: Head, photo_files: Mapping[str, str]) -> Json:
    """The contents of head.json.

    Args:
        photo_files: where in the folder each photo's pixels are, by the photo's name.
    """
    return {
        "format": FORMAT,
        "version": VERSION,
        "generator": head.generator,
        "subject": head.subject,
        "units": {
            "length": "mm",
            "axes": "x to the subject's left, y up, z out of the face",
            "pixels": "origin at the top-left corner, centre of the first pixel at (0.5, 0.5)",
        },
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


def check_version(data: Json) -> None:
    """Raises: Broken: not a head's, or from a version of mien newer than this one."""
    if data.get("format") != FORMAT:
        raise Broken("format", f"expected {FORMAT!r}, found {data.get('format')!r}")
    version = get(data, "version", int)
    if version > VERSION:
        raise Broken(
            "version",
            f"{version} was written by a newer mien ({data.get('generator', 'unknown')}); "
            f"this one reads up to {VERSION}",
        )


def get(data: Json, key: str, kind: type[Kind], place: str = "") -> Kind:
    """data[key], which must be of this kind. Raises: Broken."""
    where = f"{place}.{key}" if place else key
    if key not in data:
        raise Broken(where, "missing")
    value = data[key]
    if kind is float and isinstance(value, int):
        value = float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise Broken(where, f"expected {_KIND_NAMES[kind]}, found {str(value)[:40]!r}")
    return value


def get_texts(data: Json, key: str, place: str = "") -> dict[str, str]:
    """data[key], an object whose values are text. Raises: Broken."""
    texts = get(data, key, dict, place)
    return {name: get(texts, name, str, key) for name in texts}


def get_names(data: Json, key: str) -> tuple[str, ...]:
    """data[key], a list of texts. Raises: Broken."""
    names = get(data, key, list)
    for name in names:
        if not isinstance(name, str):
            raise Broken(key, f"expected names, found {str(name)[:40]!r}")
    return tuple(names)


def get_path(data: Json, key: str, place: str = "") -> str:
    """data[key], a path that stays inside the folder. Raises: Broken."""
    path = get(data, key, str, place)
    if not is_inside(path):
        raise Broken(f"{place}.{key}", f"expected a path inside the folder, found {path!r}")
    return path


def is_inside(path: str) -> bool:
    """Whether a relative path, with forward slashes, leads to somewhere below its folder."""
    plain = PurePosixPath(path)
    leaves = plain.is_absolute() or ".." in plain.parts
    return bool(path) and not leaves and not {"\\", "\0"} & set(path)


def views_from_json(data: Json, expression: str) -> tuple[FittedView, ...]:
    """The cameras of one expression. Raises: Broken; InputError: a camera that is none."""
    place = f"expressions.{expression}.cameras"
    items = get(get(data, expression, dict, "expressions"), "cameras", list, place[:-8])
    return tuple(_view_from_json(item, f"{place}[{i}]") for i, item in enumerate(items))


def motion_from_json(data: Json, place: str) -> Json:
    """Units and gaze of an expression, as fields of model.head.Expression; a head of an older mien
    has none. Raises: Broken."""
    units = get(data, "units", dict, place) if "units" in data else {}
    weights = {name: get(units, name, float, f"{place}.units") for name in units}
    if "gaze_rad" not in data:
        return {"units": weights}
    gaze = get(data, "gaze_rad", dict, place)
    eyes = [get(gaze, eye, dict, f"{place}.gaze_rad") for eye in _EYES]
    angles = [
        [get(item, axis, float, f"{place}.gaze_rad.{eye}") for axis in ("yaw", "pitch")]
        for eye, item in zip(_EYES, eyes, strict=True)
    ]
    return {"units": weights, "gaze": np.array(angles)}


def shading_from_json(data: Json) -> dict[str, tuple[float, float, float]]:
    """Coefficients by part; a head of an older mien has the usual ones. Raises: Broken."""
    if "shading" not in data:
        return dict(SHADING)
    shading = get(data, "shading", dict)
    terms = {part: _get_array(shading, part, (3,), "shading").tolist() for part in shading}
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
        "distrusted": dict(view.distrusted),
        "gains": view.gains.tolist(),
    }


def _view_from_json(item: object, place: str) -> FittedView:
    if not isinstance(item, dict):
        raise Broken(place, "expected an object")
    camera = Camera(
        width=get(item, "width", int, place),
        height=get(item, "height", int, place),
        focal_px=get(item, "focal_px", float, place),
        R_cam_head=_get_array(item, "R_cam_head", (3, 3), place),
        t_cam_head=_get_array(item, "t_cam_head_mm", (3,), place),
        principal_px=_get_array(item, "principal_px", (2,), place),
    )
    return FittedView(
        photo=get(item, "photo", str, place),
        camera=camera,
        rms_px=get(item, "rms_px", float, place),
        points_used=get(item, "points_used", int, place),
        distrusted=get_texts(item, "distrusted", place),
        gains=_get_array(item, "gains", (3,), place) if "gains" in item else np.ones(3),
    )


def _get_array(data: Json, key: str, shape: tuple[int, ...], place: str) -> Array:
    return check_array(f"{place}.{key}", get(data, key, list, place), shape)


_KIND_NAMES: dict[type, str] = {
    int: "a whole number",
    float: "a number",
    str: "text",
    list: "a list",
    dict: "an object",
}
