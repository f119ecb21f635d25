"""Clips and cameras: decoding, orientation, choice of frames."""
