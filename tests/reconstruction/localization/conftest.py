"""Somebody with marbled skin, and photos of her face."""

from __future__ import annotations

import pytest

from marbled import Person, photographed
from mien.camera import Camera
from mien.capture.source import CapturedView
from people import person


@pytest.fixture(scope="session")
def ann() -> Person:
    return Person(person(3), 1)


@pytest.fixture(scope="session")
def frontal(ann: Person) -> list[tuple[CapturedView, Camera]]:
    """Photos of her in which a detector would find the face."""
    return photographed(ann, (-40.0, 0.0, 40.0))
