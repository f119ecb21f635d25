"""Draws the pictures of docs/method/texture.md: python -m tools.draw_texture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from mien.arrays import Array, Int, UInt8
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.capture.source import load_capture
from mien.mesh import Mesh
from mien.reconstruction.fit import FitOptions, fit_views
from mien.render.orbit import orbit_camera
from mien.render.shade import render
from mien.texture.atlas import atlas_surface
from mien.texture.cylinder import cylinder_surface, fit_cylinder
from mien.texture.extract import Texture, extract_texture
from mien.texture.fill import FILLS
from mien.texture.subject import subject_mask
from mien.texture.visibility import prepare_view

ROOT = Path(__file__).parents[1]
PHOTOS = ROOT / "src" / "mien" / "assets" / "data" / "james"
FOLDER = ROOT / "docs" / "images"
_GREY = (96, 96, 96)


@dataclass(frozen=True)
class _Fitted:
    mesh: Mesh
    cameras: list[Camera]
    photos: list[Array]


def main() -> None:
    """Writes every picture."""
    fitted = _fit()
    FOLDER.mkdir(parents=True, exist_ok=True)
    around = cylinder_surface(fitted.mesh, fit_cylinder(fitted.mesh), width=1024, height=512)
    unfilled, filled = (
        extract_texture(
            fitted.mesh,
            fitted.cameras,
            fitted.photos,
            surface=around,
            fill=fill,
            regions=load_generic_head().regions,
        )
        for fill in (FILLS[2], FILLS[0])
    )
    coverage = np.clip(unfilled.coverage / unfilled.coverage.max() * 255, 0, 255).astype(np.uint8)
    weights = np.repeat(coverage[..., None], 3, axis=2)
    _save(np.vstack([unfilled.pixels, weights, filled.pixels]), "cylinder")
    _save(np.hstack([_usable(fitted, k) for k in range(len(fitted.photos))]), "usable")
    generic = load_generic_head()
    plain, mirrored = (_atlas(fitted, mirror) for mirror in (None, generic.mirror))
    _save(np.vstack([_views(fitted.mesh, texture) for texture in (plain, mirrored)]), "views")
    _save(np.asarray(Image.fromarray(mirrored.pixels).resize((900, 900))), "atlas")


def _fit() -> _Fitted:
    generic = load_generic_head()
    views = load_capture(PHOTOS).expressions["neutral"]
    fit = fit_views(views, generic, FitOptions())
    pixels = {view.photo.name: view.photo.pixels for view in views}
    return _Fitted(
        generic.mesh.with_vertices(fit.vertices),
        [photo.camera for photo in fit.photos.values()],
        [pixels[name] for name in fit.photos],
    )


def _atlas(fitted: _Fitted, mirror: Int[Array, " v"] | None) -> Texture:
    return extract_texture(
        fitted.mesh,
        fitted.cameras,
        fitted.photos,
        surface=atlas_surface(fitted.mesh),
        mirror=mirror,
        regions=load_generic_head().regions,
    )


def _views(mesh: Mesh, texture: Texture) -> UInt8[Array, "h w 3"]:
    skin = mesh.vertices_of("skin")
    images = []
    for yaw in (0, 45, 90, 180):
        camera = orbit_camera(np.radians(yaw), width=320, height=400, vertices=mesh.vertices[skin])
        image = render(mesh, camera, texture.pixels, samples=4, background=_GREY)
        images.append(image[..., :3])
    return np.hstack(images)


def _usable(fitted: _Fitted, k: int) -> UInt8[Array, "h w 3"]:
    """A photo, red where it is not the person, green where the mesh is not to be trusted."""
    camera, photo = fitted.cameras[k], fitted.photos[k]
    solid = fitted.mesh.submesh(
        fitted.mesh.triangles_of("skin", "left_eyeball", "right_eyeball", "upper_teeth")
    )
    person = subject_mask(solid, camera, photo)
    view = prepare_view(solid, camera, photo, subject=person)
    painted = photo.copy()
    head = np.isfinite(view.depth)
    for mask, colour in ((~person, (120, 0, 0)), (head & ~view.usable, (0, 120, 0))):
        painted[mask] = painted[mask] // 2 + np.array(colour, np.uint8)
    height = round(640 * photo.shape[0] / photo.shape[1])
    return np.asarray(Image.fromarray(painted).resize((640, height)))


def _save(picture: Array, name: str) -> None:
    Image.fromarray(picture).save(FOLDER / f"texture-{name}.jpg", quality=86, optimize=True)


if __name__ == "__main__":
    main()
