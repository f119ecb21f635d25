"""From coefficients to a picture: warping, mixing and blending subregions."""
