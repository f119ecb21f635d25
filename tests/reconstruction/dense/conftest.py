"""Somebody with marbled skin, her photos, and what is exactly true of them."""

from __future__ import annotations

import pytest

from marbled import Person, detected, photographed
from mien.camera import Camera
from mien.capture.source import CapturedView
from people import person


@pytest.fixture(scope="session")
def ann() -> Person:
    return Person(person(3), 1)


@pytest.fixture(scope="session")
def photos(ann: Person) -> list[tuple[CapturedView, Camera]]:
    """Photos of her from four sides with their true cameras and rough landmarks."""
    exact = photographed(ann, (-32.0, -10.0, 12.0, 30.0))
    return [(detected(view, camera, ann.vertices), camera) for view, camera in exact]
