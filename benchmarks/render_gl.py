"""OpenGL draws the scene in passes, as [Pighin 2002] does. benchmarks.render runs it on its own."""

from __future__ import annotations

import importlib.util
import os
from typing import Any

import numpy as np

from benchmarks.render_scene import RenderScene, arguments, build_scene, measure
from mien.arrays import Array
from mien.rig.state import PosedFace

SECONDS = 6.0
NEAR, FAR = 100.0, 5000.0

VERTEX = """
#version 330
uniform vec4 lens; uniform vec2 planes;
in vec3 place; in float brightness; in float weight; in vec2 uv;
out vec2 at; out float share; out float light;
void main() {
    at = uv; share = weight; light = brightness;
    float near = planes.x, far = planes.y;
    float z = (place.z * (far + near) - 2.0 * far * near) / (far - near);
    gl_Position = vec4(lens.xy * place.xy + lens.zw * place.z, z, place.z);
}
"""
# The same sharpness as mien's: see docs/method/rendering.md.
FRAGMENT = """
#version 330
uniform sampler2D image;
in vec2 at; in float share; in float light;
out vec4 colour;
void main() { colour = share * vec4(light * texture(image, at, -0.5).rgb, 1.0); }
"""
WHOLE = """
#version 330
const vec2 corners[3] = vec2[](vec2(-1, -1), vec2(3, -1), vec2(-1, 3));
void main() { gl_Position = vec4(corners[gl_VertexID], 0, 1); }
"""
STRAIGHT = """
#version 330
uniform sampler2D image;
out vec4 colour;
void main() {
    vec4 sum = texelFetch(image, ivec2(gl_FragCoord.xy), 0);
    colour = vec4(sum.rgb / max(sum.a, 1e-3), sum.a);
}
"""


def is_installed() -> bool:
    """Whether moderngl is."""
    return importlib.util.find_spec("moderngl") is not None


def version() -> str:
    """Of the OpenGL that draws."""
    info = _context().info
    return f"{info['GL_RENDERER']}; {info['GL_VERSION']}"


def _context() -> Any:
    """Without a window."""
    import moderngl

    options: dict[str, Any] = {"standalone": True, "backend": "egl"}
    return moderngl.create_context(**options)


class PassRenderer:
    """K passes over the consensus geometry, added up in a half-float target of 4 samples a pixel.

    The first pass writes depth, the others draw where they meet the same depth. The sum becomes
    straight alpha of 8 bits on the GPU's side, and is read back as such.
    """

    def __init__(self, scene: RenderScene) -> None:
        import moderngl

        self.gl: Any = moderngl
        self.context = context = _context()
        self.camera, self.count = scene.camera, len(scene.textures)
        size = (scene.camera.width, scene.camera.height)
        pairs = np.stack([scene.mesh.triangles, scene.mesh.uv_triangles], axis=-1).reshape(-1, 2)
        corners, index = np.unique(pairs, axis=0, return_inverse=True)
        self.vertices = corners[:, 0]
        self.program = context.program(VERTEX, FRAGMENT)
        self.textures = [self._texture(texture) for texture in scene.textures]
        at = scene.mesh.uvs[corners[:, 1]] * [1, -1] + [0, 1]
        uvs = context.buffer(at.astype("f4"))
        indices = context.buffer(index.astype("i4").ravel())
        self.data = context.buffer(reserve=len(corners) * 4 * (4 + self.count), dynamic=True)
        self.passes = [
            context.vertex_array(
                self.program,
                [
                    (self.data, _layout(k, self.count), "place", "brightness", "weight"),
                    (uvs, "2f", "uv"),
                ],
                indices,
            )
            for k in range(self.count)
        ]
        self.sums = context.framebuffer(
            context.renderbuffer(size, 4, samples=4, dtype="f2"),
            context.depth_renderbuffer(size, samples=4),
        )
        self.resolved = context.texture(size, 4, dtype="f2")
        self.target = context.framebuffer(self.resolved)
        self.straight = context.vertex_array(context.program(WHOLE, STRAIGHT), [])
        self.bytes = context.framebuffer(context.renderbuffer(size, 4))
        self._set_camera()

    def render(self, face: PosedFace) -> Array:
        """(H, W, 4) uint8 with straight alpha."""
        gl, context = self.gl, self.context
        rows = (self.camera.to_camera(face.vertices), face.brightness[:, None], face.weights)
        self.data.write(np.hstack(rows)[self.vertices].astype("f4"))
        self.sums.use()
        self.sums.clear()
        context.enable_only(gl.DEPTH_TEST | gl.BLEND)
        context.blend_func = gl.ONE, gl.ONE
        for k, drawn in enumerate(self.passes):
            context.depth_func = "<" if k == 0 else "=="
            self.sums.depth_mask = k == 0
            self.textures[k].use()
            # Only the nearest surface counts in the first pass, so nothing is added there.
            (context.disable if k == 0 else context.enable)(gl.BLEND)
            drawn.render()
        self.sums.depth_mask = True
        context.copy_framebuffer(self.target, self.sums)
        self.bytes.use()
        context.enable_only(gl.NOTHING)
        self.resolved.use()
        self.straight.render(vertices=3)
        picture = np.frombuffer(self.bytes.read(components=4), np.uint8)
        return picture.reshape(self.camera.height, self.camera.width, 4)

    def _texture(self, pixels: Array) -> Any:
        texture = self.context.texture(pixels.shape[1::-1], 3, np.ascontiguousarray(pixels))
        texture.build_mipmaps()
        texture.filter = self.gl.LINEAR_MIPMAP_LINEAR, self.gl.LINEAR
        return texture

    def _set_camera(self) -> None:
        width, height = self.camera.width, self.camera.height
        x, y = self.camera.principal
        focal = 2 * self.camera.focal_px
        # Rows count downwards on both sides, so that the picture is read the right way up.
        lens = (focal / width, focal / height, 2 * x / width - 1, 2 * y / height - 1)
        self.program["lens"], self.program["planes"] = lens, (NEAR, FAR)


def _layout(texture: int, textures: int) -> str:
    """Three floats, one, and this texture's weight among all."""
    before, after = 4 * texture, 4 * (textures - 1 - texture)
    skip = f"{before}x " if before else ""
    return f"3f 1f {skip}1f" + (f" {after}x" if after else "")


def main() -> None:
    """Prints one line of JSON."""
    # As many as mien: Mesa would count the machine's cores, not the process's.
    os.environ["LP_NUM_THREADS"] = str(len(os.sched_getaffinity(0)))
    width, height, textures, texels, frames, picture = arguments()
    scene = build_scene(width, height, textures, texels=texels)
    renderer = PassRenderer(scene)
    measure(lambda face: renderer.render(scene.faces[face]), SECONDS, frames, picture)


if __name__ == "__main__":
    main()
