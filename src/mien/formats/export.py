"""A head to a file that other programs open; the suffix tells the kind."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from mien.errors import InputError
from mien.model.head import Head


def export_head(
    head: Head, path: str | Path, *, parts: Iterable[str] | None = None, units: bool = True
) -> None:
    """Write the head as .glb, .obj (with .mtl and .png beside it) or .usdz.

    Args:
        parts: names of the mesh's parts; by default all but the hair cap and the lashes.
        units: with the face units as morph targets; an .obj cannot hold any.
    Raises: InputError: another suffix, an unknown part, a place that cannot be written;
        for .usdz that usd-core is not installed.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".glb":
        from mien.formats.gltf import save_glb

        save_glb(head, path, parts=parts, units=units)
    elif suffix == ".obj":
        from mien.formats.obj import save_obj

        save_obj(head, path, parts=parts)
    elif suffix == ".usdz":
        from mien.formats.usd import save_usdz

        save_usdz(head, path, parts=parts, units=units)
    else:
        raise InputError(path, "a name that ends in .glb, .obj or .usdz", suffix or "no suffix")
