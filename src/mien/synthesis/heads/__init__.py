"""Synthesis on a head: feature points in space."""
