"""Photographs of a person to a textured head that can be posed, animated and exported.

Start with `build_head` (photos to a `Head`), `render_head`, `export_head` and `animate_head`;
`track_video` follows a head through a video, and `synthesize_expression` draws expressions that no
photo shows. More is in `mien.animate`, `mien.capture`, `mien.io`, `mien.reconstruction`,
`mien.render`, `mien.rig`, `mien.synthesis`, `mien.texture` and `mien.track`.

Everything is loaded when it is first used, so that `import mien` costs next to nothing.
"""

from mien.lazy import public_names

_get, __dir__ = public_names(__name__, __file__)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        return version("mien")
    return _get(name)
