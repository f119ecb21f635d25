"""`head.json`: everything about a head that is not an array or a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from mien.camera import Camera
from mien.errors import DocumentError, InputError
from mien.head import GRADES, SHADING, FittedView, Grade, Head, Verdict
from mien.limits import MAX_PHOTO_SIDE, UNIT_RANGE
from mien.reading.names import is_inside
from mien.reading.strict_json import DocumentFormat, JsonValue

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
        **_verdict_to_json(head.verdict),
        "face_units": list(head.unit_names),
    }


def check_head_format(data: JsonValue) -> None:
    """Raises: DocumentError: not a head's, from a newer version of mien, in other units."""
    HEAD_FORMAT.check(data)
    for name, expected in UNITS.items():
        data["units"][name].choice(name, (expected,))


def texts_from_json(data: JsonValue) -> dict[str, str]:
    """An object whose values are text. Raises: DocumentError."""
    return {name: text.text() for name, text in data.members().items()}


def texture_paths(data: JsonValue) -> dict[str, str]:
    """Path of each texture within the folder. Raises: DocumentError: one outside of it."""
    for path in data.members().values():
        if not is_inside(path.text()):
            raise path.error(f"expected a path inside the folder, found {path.raw[:60]!r}")
    return texts_from_json(data)


def views_from_json(data: JsonValue) -> tuple[FittedView, ...]:
    """The cameras of an expression. Raises: DocumentError."""
    return tuple(_view_from_json(item) for item in data.items())


def units_and_gaze_from_json(data: JsonValue) -> dict[str, Any]:
    """Units and gaze of an expression, as fields of head.Expression. Raises: DocumentError.

    Heads of older versions of mien have none.
    """
    low, high = UNIT_RANGE
    units = data.get("units", {}).members()
    weights = {name: weight.number(least=low, most=high) for name, weight in units.items()}
    if "gaze_rad" not in data:
        return {"units": weights}
    gaze = data["gaze_rad"]
    angles = [[gaze[eye][axis].number(least=-np.pi, most=np.pi) for axis in _AXES] for eye in _EYES]
    return {"units": weights, "gaze": np.array(angles)}


def shading_from_json(data: JsonValue) -> dict[str, tuple[float, float, float]]:
    """Coefficients by part, SHADING where there are none. Raises: DocumentError."""
    if "shading" not in data:
        return dict(SHADING)
    data["shading"].members(SHADING)
    terms = {part: data["shading"][part].array(3).tolist() for part in SHADING}
    return {part: (c0, c1, c2) for part, (c0, c1, c2) in terms.items()}


def verdict_from_json(data: JsonValue) -> Verdict | None:
    """How far the head is to be believed; None of an older one. Raises: DocumentError."""
    if "verdict" not in data:
        return None
    verdict = data["verdict"]
    grade = verdict["grade"].choice("grade", GRADES)
    return Verdict(cast(Grade, grade), tuple(text.text() for text in verdict["reasons"].items()))


def _verdict_to_json(verdict: Verdict | None) -> Json:
    if verdict is None:
        return {}
    return {"verdict": {"grade": verdict.grade, "reasons": list(verdict.reasons)}}


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


def _view_from_json(item: JsonValue) -> FittedView:
    try:
        camera = Camera(
            width=item["width"].whole(above=0, most=MAX_PHOTO_SIDE),
            height=item["height"].whole(above=0, most=MAX_PHOTO_SIDE),
            focal_px=item["focal_px"].number(above=0),
            R_cam_head=item["R_cam_head"].array(3, 3),
            t_cam_head=item["t_cam_head_mm"].array(3),
            principal_px=item["principal_px"].array(2),
        )
        return FittedView(
            photo=item["photo"].text(),
            camera=camera,
            rms_px=item["rms_px"].number(least=0),
            points_used=item["points_used"].whole(least=0),
            outliers=texts_from_json(item["distrusted"]),
            gains=item.get("gains", [1.0, 1.0, 1.0]).array(3),
        )
    except InputError as error:
        problem = f"expected {error.expected}, found {error.got}"
        raise DocumentError(f"{item.place}.{error.name}", problem) from None
