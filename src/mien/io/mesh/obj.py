"""A head as Wavefront .obj, with its .mtl and its texture as .png beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int
from mien.head import NEUTRAL, Head
from mien.io.files.atomic import atomic_file
from mien.io.files.image import encode_image
from mien.io.mesh.export_surface import ExportSurface, export_surface
from mien.mesh import Mesh


def save_obj(
    head: Head,
    path: str | Path,
    *,
    parts: Iterable[str] | None = None,
    expression: str = NEUTRAL,
) -> None:
    """Write one expression in millimetres: X.obj, X.mtl and, where it has a texture, X.png.

    A group and a material for each group of parts. Face units have no place in the format; files
    of several expressions have the same vertices in the same order, as programs want that make
    blend shapes of them.

    Args:
        head: the head.
        path: the file.
        parts: names of parts; by default all but the hair cap and the lashes.
        expression: which of the photographed ones, with its texture.

    Raises:
        InputError: an unknown part or expression, a place that cannot be written.
    """
    path = Path(path)
    surface = export_surface(_with_neutral(head, expression), parts=parts, units=False)
    library, picture = (file.name for file in side_files(path))
    if surface.texture is None:
        picture = ""
    title = f"# {head.generator}: {' '.join(head.subject.split())}\n"
    texts = {path: _obj(surface, library), path.with_name(library): _mtl(surface, picture)}
    # The files name each other, by the bytes of their names.
    contents = {
        file: (title + text).encode("utf-8", "surrogateescape") for file, text in texts.items()
    }
    if surface.texture is not None:
        contents[path.with_name(picture)] = encode_image(surface.texture, "PNG")
    with ExitStack() as stack:
        for file, data in contents.items():
            stack.enter_context(atomic_file(file)).write_bytes(data)


def side_files(path: Path) -> tuple[Path, Path]:
    """The .mtl and the .png beside an .obj; many readers end a file's name at the first space."""
    stem = re.sub(r"\s+", "_", path.stem)
    return path.with_name(f"{stem}.mtl"), path.with_name(f"{stem}.png")


def _with_neutral(head: Head, name: str) -> Head:
    """The head as if this expression were its neutral one, and its only one."""
    mesh, expression = head.expression_mesh(name), head.expressions[name]
    if expression.texture not in head.textures:
        expression = replace(expression, texture=head.expressions[NEUTRAL].texture)
    return replace(head, mesh=mesh, expressions={NEUTRAL: expression})


def _obj(surface: ExportSurface, library: str) -> str:
    mesh = surface.mesh
    lines = ["# millimetres; x to the subject's left, y up, z out of the face", f"mtllib {library}"]
    lines += [*_rows("v", mesh.vertices), *_rows("vt", mesh.uvs), *_rows("vn", surface.normals)]
    for group in surface.groups:
        lines += [f"g {group.name}", f"usemtl {group.name}", *_faces(mesh, group.triangles)]
    return "\n".join(lines) + "\n"


def _rows(keyword: str, numbers: Float[Array, "n d"]) -> list[str]:
    """A line for each row, to seven digits: what float32 holds."""
    form = keyword + " %.7g" * numbers.shape[1]
    return [form % tuple(row) for row in numbers.tolist()]


def _faces(mesh: Mesh, triangles: Int[Array, " f"]) -> list[str]:
    """A line for each triangle: vertex/texture/normal, counted from 1, normals as vertices."""
    vertex = mesh.triangles[triangles] + 1
    if len(mesh.uv_triangles) == 0:
        corners, form = np.stack([vertex, vertex], -1), "f" + " %d//%d" * 3
    else:
        uv = mesh.uv_triangles[triangles] + 1
        corners, form = np.stack([vertex, uv, vertex], -1), "f" + " %d/%d/%d" * 3
    return [form % tuple(row) for row in corners.reshape(len(corners), -1).tolist()]


def _mtl(surface: ExportSurface, picture: str) -> str:
    texture = [f"map_Kd {picture}"] if picture else []
    lines = []
    for group in surface.groups:
        lines += [f"newmtl {group.name}", "Ka 0 0 0", "Kd 1 1 1", "Ks 0 0 0", "illum 1", *texture]
    return "\n".join(lines) + "\n"
