"""Array types with named axes, and the checks that guard public functions.

Axis names used throughout: v vertices, f triangles, u texture vertices, n points, k photos,
h and w image rows and columns, c colour channels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped, UInt8, UInt16

from mien.errors import InputError

__all__ = [
    "Array",
    "Bool",
    "Float",
    "Int",
    "Shaped",
    "UInt8",
    "UInt16",
    "check_array",
    "check_image",
    "check_positive",
    "check_rotation",
    "frozen",
]

Array = np.ndarray[Any, np.dtype[Any]]


def check_array(
    name: str,
    value: object,
    shape: tuple[int | None, ...],
    *,
    dtype: Any = np.float64,
    finite: bool = True,
) -> Array:
    """The value as an array of this shape and type.

    Args:
        name: of the value, for messages.
        value: anything numpy can convert to an array.
        shape: one entry an axis; None accepts any length.
        dtype: the type of the result.
        finite: refuse NaN and infinity.

    Raises:
        InputError: the shape differs, the type does not convert, a number is not finite.
    """
    expected = "(" + ", ".join("any" if length is None else str(length) for length in shape) + ")"
    try:
        array: Array = np.asarray(value, dtype=dtype)
    except (TypeError, ValueError, OverflowError):
        raise InputError(name, f"numbers of shape {expected}", type(value).__name__) from None
    fits = array.ndim == len(shape) and all(
        length is None or length == actual
        for length, actual in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise InputError(name, f"shape {expected}", f"shape {array.shape}")
    if finite and array.dtype.kind == "f" and not np.isfinite(array).all():
        bad = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(name, "finite numbers", f"{array[bad]} at index {bad}")
    return array


def check_image(name: str, value: object) -> Array:
    """An sRGB image, (h, w, 3) uint8. Raises: InputError."""
    array = np.asarray(value)
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype != np.uint8 or array.size == 0:
        raise InputError(name, "an (h, w, 3) uint8 image", f"shape {array.shape}, {array.dtype}")
    return array


def check_positive(name: str, value: float) -> float:
    """A finite number above zero. Raises: InputError."""
    if not (np.isfinite(value) and value > 0):
        raise InputError(name, "a number above zero", value)
    return float(value)


def check_rotation(name: str, value: object) -> Float[Array, "3 3"]:
    """A proper rotation matrix (orthonormal to 1e-6, determinant +1). Raises: InputError."""
    matrix = check_array(name, value, (3, 3))
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if error > 1e-6 or np.linalg.det(matrix) < 0:
        raise InputError(name, "a rotation matrix", f"one off orthonormal by {error:.2g}")
    return matrix


def frozen(array: Array) -> Array:
    """A read-only view of the array, for frozen dataclasses."""
    view = array.view()
    view.flags.writeable = False
    return view
