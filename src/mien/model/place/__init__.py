"""Cameras of photos that the face detector cannot read, from those that it can."""

from mien.model.place.view import place_view, place_views

__all__ = ["place_view", "place_views"]
