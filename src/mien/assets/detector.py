"""The file of the face detector's model."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from mien.errors import FileFormatError

_MODEL_NAME = "face_landmarker.task"


def detector_model_path() -> Path:
    """The MediaPipe face landmarker's model that ships with mien (Apache-2.0).

    Raises:
        FileFormatError: the installation is incomplete.
    """
    path = Path(str(files("mien.assets"))) / "data" / _MODEL_NAME
    if not path.is_file():
        raise FileFormatError(path, "expected the face detector's model here; reinstall mien")
    return path
