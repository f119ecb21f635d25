"""Cameras from feature points by alternating linear least squares."""
