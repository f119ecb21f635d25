"""Meshes and heads as `.glb`, `.obj` and `.usdz`."""
