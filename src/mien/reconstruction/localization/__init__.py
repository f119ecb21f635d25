"""Cameras of photos that the face detector cannot read, from those that it can."""

from mien.reconstruction.localization.localizer import localize_view, localize_views

__all__ = ["localize_view", "localize_views"]
