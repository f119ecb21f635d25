"""Linear algebra, solvers, images and rasterization; nothing here knows of faces."""
