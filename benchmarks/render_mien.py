"""mien draws the scene. Run by benchmarks.render in a process of its own."""

from __future__ import annotations

from benchmarks.render_scene import arguments, build_scene, measure
from mien.arrays import Array
from mien.render.morph import MorphRenderer

SECONDS = 4.0


def main() -> None:
    """Prints one line of JSON."""
    width, height, textures, texels, frames, picture = arguments()
    scene = build_scene(width, height, textures, texels=texels)
    renderer = MorphRenderer(scene.mesh, scene.textures)

    def draw(face: int) -> Array:
        return renderer.render(scene.faces[face], scene.camera)

    measure(draw, SECONDS, frames, picture)


if __name__ == "__main__":
    main()
