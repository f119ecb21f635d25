"""Cameras of photos that the face detector cannot read, from those that it can."""

from mien.reconstruction.localization.localizer import place_view, place_views

__all__ = ["place_view", "place_views"]
