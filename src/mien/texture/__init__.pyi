"""The public names of `mien.texture`: this is their only list; `mien.lazy` reads it."""

from mien.texture.atlas import atlas_surface as atlas_surface
from mien.texture.cylinder import Cylinder as Cylinder
from mien.texture.cylinder import cylinder_surface as cylinder_surface
from mien.texture.cylinder import fit_cylinder as fit_cylinder
from mien.texture.equalize import estimate_gains as estimate_gains
from mien.texture.extract import Texture as Texture
from mien.texture.extract import extract_texture as extract_texture
from mien.texture.surface import SurfaceMap as SurfaceMap
