"""A face, small enough for quick tests, and the detector."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import mien.assets
from mien.arrays import Array
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import Photo

JAMES = Path(mien.assets.__file__).parent / "data" / "james"


@pytest.fixture(scope="session")
def faces() -> dict[str, Array]:
    """James from his left and from his right, (800, 600, 3) uint8."""
    return {
        side: np.asarray(Image.open(JAMES / f"photo_{side}.png").convert("RGB").resize((600, 800)))
        for side in ("left", "right")
    }


@pytest.fixture(scope="session")
def detector() -> Iterator[LandmarkDetector]:
    with LandmarkDetector() as detector:
        yield detector


@pytest.fixture
def as_photo() -> Callable[..., Photo]:
    """Pixels as a photo that was never a file."""

    def make(pixels: Array, name: str = "face.png") -> Photo:
        return Photo(name, Path(name), np.ascontiguousarray(pixels))

    return make
