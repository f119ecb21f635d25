"""Draws the pictures of docs/reference/generic-head.md: python -m tools.draw_generic_head."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from tools.assets.shading import Lighting, Paint, camera_at, paint_head, rasterize_mesh, shade

FOLDER = Path(__file__).parents[1] / "docs" / "images"
_UNITS = ("jawOpen", "eyeBlinkLeft", "mouthSmileLeft", "browInnerUp", "mouthPucker", "cheekPuff")
_REGIONS = ("face", "forehead", "eyes", "mouth", "nose", "lips", "left_ear", "neck", "scalp")
_HIDDEN = 3.0


def main() -> None:
    """Writes every picture."""
    head = load_generic_head()
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, rows in (
        ("views", [_views(head)]),
        ("features", [_features(head)]),
        ("landmarks", [_landmarks(head)]),
        ("units", [_units(head)]),
        ("identity", _people(head)),
        ("regions", [_regions(head)]),
    ):
        picture = np.vstack([np.hstack(list(row)) for row in rows])
        Image.fromarray(picture).save(FOLDER / f"generic-head-{name}.jpg", quality=88)
    _atlas(head).save(FOLDER / "generic-head-atlas.png", optimize=True)


def _picture(
    head: GenericHead,
    camera: Camera,
    *,
    vertices: Float[Array, "v 3"] | None = None,
    paint: Paint | None = None,
    hair: bool = False,
) -> UInt8[Array, "h w 3"]:
    mesh = head.mesh if vertices is None else head.mesh.with_vertices(vertices)
    hidden = {"lashes"} if hair else {"lashes", "hair"}
    mesh = mesh.submesh(mesh.triangles_of(*(set(mesh.part_names) - hidden)))
    return shade(mesh, camera, paint or _paint(head), Lighting())


def _paint(head: GenericHead) -> Paint:
    paint = paint_head(head.mesh, head.regions["lips"], np.zeros(len(head.mesh.vertices)))
    tongue = head.mesh.vertices_of("tongue")
    paint.colours[tongue] = (0.7, 0.35, 0.35)
    return paint


def _views(head: GenericHead) -> Iterable[Array]:
    for yaw, hair in ((0, False), (40, False), (90, False), (180, False), (40, True)):
        yield _picture(head, camera_at(yaw, size=320), hair=hair)


def _features(head: GenericHead) -> Iterable[Array]:
    for yaw in (0, 40, 85):
        camera = camera_at(yaw, size=520)
        image = Image.fromarray(_picture(head, camera))
        draw = ImageDraw.Draw(image)
        pixels, seen = _projected(head, camera, head.mesh.vertices)
        for line in head.polylines.values():
            for a, b in itertools.pairwise(line):
                if seen[a] and seen[b]:
                    draw.line([tuple(pixels[a]), tuple(pixels[b])], fill=(20, 60, 200), width=1)
            _dots(draw, pixels[[v for v in line if seen[v]]], 2, (20, 60, 200))
        _dots(draw, pixels[[v for v in head.points.values() if seen[v]]], 3, (220, 0, 0))
        yield np.asarray(image)


def _landmarks(head: GenericHead) -> Iterable[Array]:
    for yaw in (-30, 0, 30):
        camera = camera_at(yaw, size=520)
        image = Image.fromarray(_picture(head, camera))
        places = head.landmark_positions(head.mesh.vertices)
        pixels, seen = _projected(head, camera, places)
        _dots(ImageDraw.Draw(image), pixels[seen & head.landmark_attached], 1.5, (0, 120, 0))
        yield np.asarray(image)


def _units(head: GenericHead) -> Iterable[Array]:
    for name in _UNITS:
        offsets = head.unit_offsets[head.unit_names.index(name)]
        moved = head.mesh.vertices + offsets
        yield _labelled(_picture(head, camera_at(0, size=300), vertices=moved), name)


def _people(head: GenericHead) -> Iterable[list[Array]]:
    rng = np.random.default_rng(7)
    count = len(head.identity.components)
    people = [head.mesh.vertices + head.identity.offsets(rng.normal(size=count)) for _ in range(5)]
    for yaw in (0, 60):
        yield [_picture(head, camera_at(yaw, size=300), vertices=person) for person in people]


def _regions(head: GenericHead) -> Iterable[Array]:
    for name in _REGIONS:
        mask = head.regions[name][:, None]
        colours = 0.75 * (1 - mask) + mask * np.array([0.85, 0.25, 0.2])
        paint = Paint(colours, np.full(len(colours), 99.0))
        yield _labelled(_picture(head, camera_at(25, size=220), paint=paint), name)


def _atlas(head: GenericHead) -> Image.Image:
    """The layout of the texture, a colour for each part."""
    size = 900
    image = Image.new("RGB", (size, size), "white")
    draw = ImageDraw.Draw(image)
    colours = np.random.default_rng(1).integers(0, 170, (len(head.mesh.part_names), 3))
    colours[0] = 0
    pixels = head.mesh.uvs * [size, -size] + [0, size]
    for corners, part in zip(head.mesh.uv_triangles, head.mesh.part, strict=True):
        draw.polygon([tuple(p) for p in pixels[corners]], outline=tuple(colours[part].tolist()))
    return image.convert("P", palette=Image.Palette.ADAPTIVE, colors=16)


def _projected(
    head: GenericHead, camera: Camera, points: Float[Array, "n 3"]
) -> tuple[Float[Array, "n 2"], Array]:
    """Pixels of points and whether the skin leaves them visible."""
    bald = head.mesh.submesh(head.mesh.triangles_of("skin", "left_eyeball", "right_eyeball"))
    raster = rasterize_mesh(bald, camera)
    pixels = camera.project(points)
    columns, rows = np.clip(pixels.astype(int), 0, camera.width - 1).T
    return pixels, camera.to_camera(points)[:, 2] < raster.depth[rows, columns] + _HIDDEN


def _dots(
    draw: ImageDraw.ImageDraw, pixels: Array, radius: float, colour: tuple[int, int, int]
) -> None:
    for x, y in pixels:
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=colour)


def _labelled(image: UInt8[Array, "h w 3"], text: str) -> Array:
    picture = Image.fromarray(image)
    ImageDraw.Draw(picture).text((6, 6), text, fill=(255, 255, 255))
    return np.asarray(picture)


if __name__ == "__main__":
    main()
