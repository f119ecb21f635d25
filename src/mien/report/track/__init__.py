"""Plots, overlays and sheets of a track."""
