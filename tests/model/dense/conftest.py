"""Somebody with marbled skin, her photos, and what is exactly true of them."""

from __future__ import annotations

import pytest

from marbled import Person, photographed
from mien.camera import Camera
from mien.capture.source import View
from people import person


@pytest.fixture(scope="session")
def ann() -> Person:
    return Person(person(3), 1)


@pytest.fixture(scope="session")
def photos(ann: Person) -> list[tuple[View, Camera]]:
    """Photos of her from four sides with their true cameras."""
    return photographed(ann, (-32.0, -10.0, 12.0, 30.0))
