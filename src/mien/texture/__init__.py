"""Photos to the texture of a head ([Pighin 2002] sec. 5).

`extract_texture` blends photos over a `SurfaceMap`: an atlas (`atlas_surface`) or a cylinder around
the head (`fit_cylinder`, `cylinder_surface`).
"""

from mien.lazy import public_names

__getattr__, __dir__ = public_names(__name__, __file__)
