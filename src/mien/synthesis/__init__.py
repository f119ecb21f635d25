"""Expressions from feature points: examples mixed by geometry (Z06)."""
