"""mien: photographs to a textured head."""
