"""Fixtures that every folder of tests may use."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    """The same random numbers in every run."""
    return np.random.default_rng(20021)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of development data beside the checkout; a test that wants it skips without."""
    folder = Path(__file__).parents[2] / "shared"
    if not (folder / "data").is_dir():
        pytest.skip("no development data in ../shared")
    return folder
