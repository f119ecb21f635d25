"""A head to a file that other programs open; the suffix tells the kind."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from mien.errors import InputError
from mien.head import NEUTRAL, Head
from mien.io.files.atomic import check_file_place, check_files_apart, check_side_file
from mien.io.mesh.head_animation import HeadAnimation

_KINDS = (".glb", ".obj", ".usdz")


def check_export_place(path: str | Path, *, read: Iterable[str | Path] = ()) -> None:
    """Refuse, before any work is done, a place that export_head could not or must not take.

    Args:
        path: the file.
        read: files and folders that the head comes from.

    Raises:
        InputError: another suffix, a place that is read or cannot be written; for an .obj somebody
            else's file where its .mtl or .png would go.
    """
    path = Path(path)
    files = [path]
    if _check_suffix(path) == ".obj":
        from mien.io.mesh.obj import side_files

        files += side_files(path)
    check_files_apart(files, read)
    for file in files[1:]:
        check_side_file(file, path)
    for file in files:
        check_file_place(file)


def export_head(
    head: Head,
    path: str | Path,
    *,
    parts: Iterable[str] | None = None,
    units: bool = True,
    expression: str = NEUTRAL,
    animation: HeadAnimation | None = None,
) -> None:
    """Write the head as .glb, .obj (with .mtl and .png beside it) or .usdz.

    Args:
        head: the head.
        path: the file; its suffix tells the kind.
        parts: names of the mesh's parts; by default all but the hair cap and the lashes.
        units: with the face units as morph targets; an .obj cannot hold any.
        expression: which one an .obj shows; the other kinds hold all of them.
        animation: how the head moves; an .obj cannot.

    Raises:
        InputError: another suffix, an unknown part or expression, what this kind of file cannot
            hold, a place that cannot be written; for .usdz that usd-core is not installed.
    """
    suffix = _check_suffix(path)
    if suffix == ".obj":
        from mien.io.mesh.obj import save_obj

        if animation is not None:
            raise InputError(path, "a .glb or .usdz for a head that moves", suffix)
        save_obj(head, path, parts=parts, expression=expression)
        return
    if expression != NEUTRAL:
        raise InputError(path, f"an .obj for {expression} alone", f"{suffix}, which holds all")
    if suffix == ".glb":
        from mien.io.mesh.gltf import save_glb

        save_glb(head, path, parts=parts, units=units, animation=animation)
    else:
        from mien.io.mesh.usd import save_usdz

        save_usdz(head, path, parts=parts, units=units, animation=animation)


def _check_suffix(path: str | Path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in _KINDS:
        raise InputError(path, "a name that ends in .glb, .obj or .usdz", suffix or "no suffix")
    return suffix
