"""The command line, run in this process, and a head that it built once."""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mien.arrays import Array
from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import default_subregions
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.images.photos import Photo
from mien.cli.main import main
from mien.head import ATLAS, Expression
from mien.io.head.head_folder import save_head
from mien.io.landmarks.points_json import save_points_json
from mien.pipelines.build import Build, build_head
from mien.pipelines.demo import demo_photos
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.texture.cylinder import cylinder_surface
from mien.texture.extract import Texture
from mien.texture.surface import SurfaceMap
from terminal import FAST, SHORT_TURNTABLE, Built, Mien, Ran

SIZE = (375, 500)


@pytest.fixture
def mien(capfd: pytest.CaptureFixture[str]) -> Mien:
    """mien("build", source, ...) as in a terminal; what libraries print themselves counts."""

    def run(*arguments: object) -> Ran:
        capfd.readouterr()
        status = main([str(argument) for argument in arguments])
        return Ran(status, *capfd.readouterr())

    return run


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """James from small photos. Read only: other tests use it too."""
    place = tmp_path_factory.mktemp("built")
    source = small_james(place / "james")
    out, err = io.StringIO(), io.StringIO()
    results: list[Build] = []

    def remember(*arguments: Any, **options: Any) -> Build:
        results.append(build_head(*arguments, **options))
        return results[0]

    with contextlib.ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setattr("mien.pipelines.build.build_head", remember)
        patch.setattr("mien.pipelines.build.turntable_frames", SHORT_TURNTABLE)
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        status = main(["build", str(source), "-o", str(place / "head"), *FAST, "--json"])
    assert status == 0, err.getvalue()
    summary = Ran(status, out.getvalue(), err.getvalue()).json
    return Built(source, place / "head", results[0], summary)


@pytest.fixture(scope="session")
def expressive(built: Built, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A head folder: James with two faces more, made of units, greenish and reddish."""
    head = built.result.head
    faces = {"joy": ("mouthSmileLeft", "mouthSmileRight"), "anger": ("browDownLeft",)}
    expressions, textures = dict(head.expressions), dict(head.textures)
    for channel, (name, units) in enumerate(faces.items()):
        offsets = sum(head.units[head.unit_names.index(unit)] for unit in units)
        views = tuple(replace(view, photo=f"{name}/{view.photo}") for view in head.views[:1])
        weights = dict.fromkeys(units, 1.0)
        expressions[name] = Expression(head.mesh.vertices + offsets, views, name, weights)
        textures[name] = head.textures[ATLAS] // 2
        textures[name][..., channel] = head.textures[ATLAS][..., channel]
    folder = tmp_path_factory.mktemp("expressive") / "head"
    save_head(replace(head, expressions=expressions, textures=textures), folder)
    return folder


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Builds whose turntable and cylinder, the slowest stages, are small."""
    monkeypatch.setattr("mien.pipelines.build.turntable_frames", SHORT_TURNTABLE)
    monkeypatch.setattr(
        "mien.pipelines.head_textures.cylinder_surface",
        partial(cylinder_surface, width=128, height=64),
    )


@pytest.fixture
def untextured(monkeypatch: pytest.MonkeyPatch, quick: None) -> None:
    """Builds of grey heads without a report, where it is the photos and cameras that count."""

    def grey(
        mesh: object, cameras: list, *others: object, surface: SurfaceMap, **_: object
    ) -> Texture:
        shape, gains = surface.triangle_ids.shape, np.ones((len(cameras), 3))
        return Texture(np.full((*shape, 3), 128, np.uint8), np.ones(shape), gains)

    monkeypatch.setattr("mien.pipelines.head_textures.extract_texture", grey)
    monkeypatch.setattr("mien.pipelines.build.render_report", lambda data, **options: "")


@pytest.fixture
def rebuilt(built: Built, monkeypatch: pytest.MonkeyPatch, quick: None) -> None:
    """Builds that only write: what they write was computed before."""
    monkeypatch.setattr("mien.pipelines.build.build_head", lambda source, **options: built.result)


@pytest.fixture
def james(tmp_path: Path) -> Path:
    """A folder of the two small photos and their marks, to do what one likes with."""
    return small_james(tmp_path / "james")


@pytest.fixture
def bare_james(james: Path) -> Path:
    """The same without marks."""
    shutil.rmtree(james / "annotations")
    return james


def small_james(folder: Path) -> Path:
    """The photos that ship with mien, a third as large, and the marks as they are."""
    (folder / "annotations").mkdir(parents=True)
    for side in ("left", "right"):
        photo = Image.open(demo_photos() / f"photo_{side}.png").convert("RGB")
        photo.resize(SIZE, Image.Resampling.LANCZOS).save(folder / f"{side}.png")
        marks = demo_photos() / "annotations" / f"photo_{side}.json"
        shutil.copy(marks, folder / "annotations" / f"{side}.json")
    return folder


@pytest.fixture(scope="session")
def james_set() -> ExampleSet:
    """James from a photo, as it is and with moved points, told to have moved in 40 ways more."""
    layout, size = load_feature_layout(), (300, 400)
    picture = Image.open(demo_photos() / "photo_left.png").convert("RGB")
    pixels = np.asarray(picture.resize(size, Image.Resampling.LANCZOS))
    with LandmarkDetector() as detector:
        found = detector.detect(Photo("james.png", Path("james.png"), pixels))
    neutral = layout.from_landmarks(found.points)
    rng = np.random.default_rng(4)
    x, y = layout.template.T
    wave, phase = rng.normal(0, 4, (2, 5, 2)), rng.uniform(0, 6, (2, 5))
    ways = np.sin(wave[..., :1] * x + wave[..., 1:] * y + phase[..., None])  # (2, 5, n)
    seen = neutral + np.einsum("awn,mw->mna", ways, rng.normal(0, 1.0, (45, 5)))
    places = [neutral, *seen[:4]]
    pairs = enumerate(places)
    examples = tuple(Example(f"e{i}", pixels, points, "james.png") for i, points in pairs)
    subregions = default_subregions(layout, seen[0], size)
    found_set = ExampleSet(layout, examples, 1, seen, subregions)
    return replace(found_set, statistics=found_set.geometry(seen))


@pytest.fixture
def asked(tmp_path: Path) -> Callable[..., Path]:
    """P.json with these points, all of them or those that are named."""

    def write(points: Array, *names: str) -> Path:
        layout = load_feature_layout()
        given = {name: points[layout.index(name)] for name in names or layout.names}
        save_points_json(tmp_path / "P.json", layout, given)
        return tmp_path / "P.json"

    return write


@pytest.fixture
def wall() -> Array:
    """(400, 300, 3) a picture without a face."""
    return np.tile(np.linspace(0, 255, 400).astype(np.uint8)[:, None, None], (1, 300, 3))


@pytest.fixture
def contents() -> Iterator[Callable[[Path], dict[str, bytes]]]:
    """All files of a folder, hidden ones too, by relative path."""

    def read(folder: Path) -> dict[str, bytes]:
        files = (path for path in sorted(folder.rglob("*")) if path.is_file())
        return {str(path.relative_to(folder)): path.read_bytes() for path in files}

    return read
