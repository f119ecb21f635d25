"""Rasterizing triangles."""
