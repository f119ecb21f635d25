"""A thousand damaged, odd and hostile inputs over all readers: each is read, or told in one line.

`MIEN_MUTATIONS=20000 MIEN_SEED=7 pytest tests/io/test_mutated_inputs.py` takes more, others.
"""

from __future__ import annotations

import os
import shutil
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import posable
from memory import peak_bytes
from mien.animate.perform import frame_times
from mien.assets.feature_points import load_feature_layout
from mien.assets.generic import load_generic_head
from mien.assets.subregions import default_subregions, load_subregion_drawing
from mien.capture.annotations import AnnotationNames, load_annotations
from mien.capture.images.photos import Photo, load_photo
from mien.errors import MienError
from mien.io.examples.example_folder import load_examples, load_reasons, save_examples
from mien.io.files.image import encode_image, load_image
from mien.io.head.head_folder import load_head, save_head
from mien.io.landmarks.points_file import load_feature_points, save_feature_points
from mien.io.live.live_link_csv import save_live_link
from mien.io.timeline.timeline_file import load_timeline
from mien.io.tracks.track_csv import save_track
from mien.io.tracks.track_journal import Journal, load_journal
from mien.render.picture import HeadRenderer
from mien.rig.state import FaceState
from mien.synthesis.examples.example_set import Example, ExampleSet
from mutations import mutate_file
from tracks import LAYOUT, random_track

MUTATIONS = int(os.environ.get("MIEN_MUTATIONS", "1000"))
SEED = int(os.environ.get("MIEN_SEED", "14"))
SECONDS, BYTES = 10.0, 2 << 30
HEADER = {"video": "a.mp4"}

TIMELINE = """{"format": "mien timeline", "version": 1, "duration": 2, "fps": 10, "size": [64, 80],
"pivot": [0, -60, -80],
"tracks": {"units": {"jawOpen": [[0, 0], [1, 0.6]], "mouthPucker": 0.3},
 "mouth": {"joy": {"interpolation": "linear", "keys": [[0, 0.2], {"time": 1, "value": 0.7,
 "interpolation": "hold"}]}}, "head": {"yaw": [[0, 5], [2, -5]]}, "gaze": {"pitch": 3}},
"clips": {"nod": {"duration": 0.5, "tracks": {"head": {"pitch": [[0, 0], [0.25, 8], [0.5, 0]]}}}},
"play": [{"clip": "nod", "at": 0.5, "speed": 1.5, "weight": 0.8, "repeats": 2}],
"layers": [{"name": "life", "generator": "blink", "period": 3, "seed": 4},
 {"generator": "breathing", "tip": 0.4, "weight": [[0, 0], [1, 1]]}]}"""
ANNOTATIONS = """{"photo": "a.png", "size": [300, 200],
"points": {"nose_tip": [150.5, 100], "chin": [151, 170]},
"curves": {"left_jaw": [[170, 150], [160, 165], [152, 170]]}}"""


@dataclass(frozen=True)
class Reader:
    """Files that are read together, in a folder of their own, and what reads them."""

    folder: Path
    read: Callable[[Path], object]

    @property
    def files(self) -> list[Path]:
        return sorted(path for path in self.folder.rglob("*") if path.is_file())


def read_head(folder: Path) -> None:
    head = load_head(folder)
    renderer = HeadRenderer(head)
    face = FaceState({"mouth": {"joy": 0.5}}, {"jawOpen": 0.5, "eyeBlinkLeft": 0.7})
    if "joy" in head.expressions:
        picture = renderer.draw(face, renderer.camera(0.3, 0.1, size=(48, 60)))
        assert picture.shape == (60, 48, 4)


def read_performance(path: Path) -> None:
    timeline = load_timeline(path)
    times = frame_times(timeline)
    for moment in timeline.moments_at(times[:: max(1, len(times) // 5)]):
        assert np.isfinite(moment.rotation).all()


@pytest.fixture(scope="module")
def readers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Reader]:
    """By name; those that take longest are there once."""
    place = tmp_path_factory.mktemp("whole")
    rng, layout = np.random.default_rng(1), load_feature_layout()
    save_head(posable.head(), place / "head")
    _write_examples(place / "examples")
    for name in ("track", "journal", "live_link", "timeline", "points", "photos", "drawn"):
        (place / name).mkdir()
    track = random_track(rng)
    save_track(place / "track" / "t.csv", track)
    with Journal.start(place / "journal" / "t.csv.part", HEADER, track.frames):
        pass
    (place / "timeline" / "t.json").write_text(TIMELINE)
    moments = load_timeline(place / "timeline" / "t.json")
    save_live_link(place / "live_link" / "t.csv", moments.moments_at(frame_times(moments)))
    for suffix in ("json", "tem", "pts"):
        save_feature_points(place / "points" / f"p.{suffix}", layout, 100 * layout.template + 150)
    pixels = rng.integers(0, 256, (20, 30, 3), np.uint8).repeat(10, axis=0).repeat(10, axis=1)
    for name, kind in (("a.png", "PNG"), ("b.jpg", "JPEG")):
        (place / "photos" / name).write_bytes(encode_image(pixels, kind))
    photo = Photo("a.png", place / "photos" / "a.png", pixels, original_size=(300, 200))
    names = AnnotationNames.of(load_generic_head())
    (place / "drawn" / "a.json").write_text(ANNOTATIONS)
    data = Path(load_feature_layout.__code__.co_filename).parent / "data"
    for name in ("zhang134.json", "zhang134_subregions.json"):
        shutil.copy(data / name, place / "drawn" / name)
    read: dict[str, Callable[[Path], object]] = {
        "head": read_head,
        "examples": lambda folder: (load_examples(folder), load_reasons(folder)),
        "track": lambda folder: read_performance(folder / "t.csv"),
        "journal": lambda folder: load_journal(folder / "t.csv.part", HEADER, LAYOUT),
        "live_link": lambda folder: read_performance(folder / "t.csv"),
        "timeline": lambda folder: read_performance(folder / "t.json"),
        "points": lambda folder: [
            load_feature_points(folder / f"p.{suffix}", layout) for suffix in ("json", "tem", "pts")
        ],
        "photos": lambda folder: [
            (load_image(folder / name), load_photo(folder / name)) for name in ("a.png", "b.jpg")
        ],
        "drawn": lambda folder: (
            load_annotations(folder / "a.json", photo, names=names),
            load_feature_layout(folder / "zhang134.json"),
            load_subregion_drawing(layout, folder / "zhang134_subregions.json"),
        ),
    }
    found = {name: Reader(place / name, function) for name, function in read.items()}
    for reader in found.values():
        reader.read(reader.folder)
    return found


def _write_examples(folder: Path) -> None:
    layout, rng = load_feature_layout(), np.random.default_rng(2)
    points = [60 * layout.template + (55, 60), 60 * layout.template + (56, 61)]
    examples = tuple(
        Example(name, rng.integers(0, 256, (120, 110, 3), np.uint8), place, name)
        for name, place in zip(("rest", "joy"), points, strict=True)
    )
    subregions = default_subregions(layout, points[1], (110, 120))
    save_examples(folder, ExampleSet(layout, examples, 1, np.stack(points), subregions))
    names = {f"members/{n}": m for n, m in zip(subregions.names, subregions.members, strict=True)}
    np.savez_compressed(
        folder / "subregions.npz", names=np.array(subregions.names), fades=subregions.fades, **names
    )


def test_a_thousand_damaged_inputs_raise_one_line_errors(
    readers: dict[str, Reader], tmp_path: Path
) -> None:
    others = [reader.files[-1].read_bytes() for reader in readers.values()]
    told: Counter[str] = Counter()
    before = peak_bytes()
    for number in range(MUTATIONS):
        rng = np.random.default_rng((SEED, number))
        name = list(readers)[rng.integers(len(readers))]
        folder = tmp_path / f"m{number}"
        shutil.copytree(readers[name].folder, folder)
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        file = files[rng.integers(len(files))]
        done = f"mutation {number}, {name}, {file.name} {mutate_file(file, others, rng)}"
        start = time.perf_counter()
        try:
            readers[name].read(folder)
        except MienError as error:
            text = str(error)
            assert str(folder) in text, f"{done} names no file: {text}"
            assert "\n" not in text, f"{done}: more than one line: {text}"
            told[name] += 1
        except Exception as error:
            raise AssertionError(f"{done}: {type(error).__name__}: {error}") from error
        else:
            told[f"{name} read"] += 1
        assert time.perf_counter() - start < SECONDS, done
        shutil.rmtree(folder)

    assert all(told[name] for name in readers), told
    assert peak_bytes() - before < BYTES
