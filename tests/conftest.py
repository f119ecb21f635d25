"""Fixtures that every folder of tests may use."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

pytest_plugins = ["commands"]


def pytest_configure(config: pytest.Config) -> None:
    """Processes that test side by side share the cores, and with them each its threads."""
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))
    if hasattr(config, "workerinput"):
        import numba

        # OpenCV keeps its own: told to use one, its first results differ in the last digit.
        numba.set_num_threads(max(1, numba.config.NUMBA_NUM_THREADS // processes))
    elif config.getoption("numprocesses", None):
        # Read when NumPy is loaded, which here is too late, but not in the processes to come.
        for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
            os.environ.setdefault(variable, "1")


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
