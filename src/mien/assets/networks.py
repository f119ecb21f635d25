"""The files of the networks that ship with mien."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from mien.errors import FileFormatError


def detector_model_path() -> Path:
    """MediaPipe's face landmarker (Apache-2.0). Raises: FileFormatError: not there."""
    return _data_file("face_landmarker.task", "the face detector's model")


def person_model_path() -> Path:
    """MediaPipe's selfie segmentation (Apache-2.0). Raises: FileFormatError: not there."""
    return _data_file("selfie_segmentation.tflite", "the model that tells people from background")


def _data_file(name: str, what: str) -> Path:
    path = Path(str(files("mien.assets"))) / "data" / name
    if not path.is_file():
        raise FileFormatError(path, f"expected {what} here; reinstall mien")
    return path
