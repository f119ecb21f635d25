"""Tracks as tables."""
