"""Sampling, optical flow and hole filling of images."""
