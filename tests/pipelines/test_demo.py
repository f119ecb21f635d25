"""`mien demo` as its first user sees it."""

from __future__ import annotations

import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.assets.generic import load_generic_head
from mien.io.head.head_folder import load_head
from mien.io.timeline.timeline_json import load_timeline_json
from mien.pipelines.demo import PERFORMANCE, TURNTABLE, UNITS, YAWS, demo_photos, run_demo
from terminal import SHORT_TURNTABLE, Mien, Ran


class Links(HTMLParser):
    """Everything that a page points to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.targets += [value or "" for name, value in attrs if name in {"src", "href", "poster"}]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The real one, once, but for a short turntable and few frames of the performance."""
    stages: list[tuple[str, int, int]] = []
    folder = tmp_path_factory.mktemp("demo") / "demo"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mien.pipelines.build.turntable_frames", SHORT_TURNTABLE)
        patch.setattr("mien.pipelines.demo._FPS", 2)
        index = run_demo(folder, progress=lambda *told: stages.append(told))
    assert index == folder / "index.html"
    finished = {stage for stage, done, total in stages if done == total}
    assert finished == {stage for stage, _, _ in stages}
    return folder


def test_everything_that_the_pages_point_to_is_there(demo: Path) -> None:
    for page in (demo / "index.html", demo / "head" / "report.html"):
        targets = Links(page.read_text(encoding="utf-8")).targets
        assert len(targets) > 5
        for target in targets:
            if not target.startswith("data:"):
                assert (page.parent / target).is_file(), f"{page.name}: {target}"


def test_the_page_shows_every_picture(demo: Path) -> None:
    page = (demo / "index.html").read_text(encoding="utf-8")
    for picture in (demo / "pictures").iterdir():
        assert f"pictures/{picture.name}" in page
        with Image.open(picture) as image:
            assert image.size == (480, 600)
            assert np.asarray(image).std() > 10
    assert len(list((demo / "pictures").iterdir())) == len(YAWS) + len(UNITS)
    assert f"head/{TURNTABLE}" in page


def test_the_photos_and_the_head_are_james(demo: Path) -> None:
    head = load_head(demo / "head")
    assert head.subject == "james"
    assert [view.photo for view in head.views] == ["photo_left.png", "photo_right.png"]
    for view in head.views:
        assert view.points_used > 60
        assert view.rms_px < 10
        kept = (demo / "head" / "photos" / view.photo, demo_photos() / view.photo)
        with Image.open(kept[0]) as image, Image.open(kept[1]) as given:
            np.testing.assert_array_equal(np.asarray(image), np.asarray(given.convert("RGB")))
    assert not head.left_out


def test_the_sample_timeline_is_performed_and_shown(demo: Path) -> None:
    import av

    with av.open(demo / PERFORMANCE) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 20
    assert frames[0].shape == (600, 480, 3)
    moved = [np.abs(frame.astype(int) - frames[0]).mean() for frame in frames]
    assert max(moved) > 2
    page = (demo / "index.html").read_text(encoding="utf-8")
    assert f'<video src="{PERFORMANCE}"' in page
    assert load_timeline_json(demo / "sample_timeline.json").duration == 10


def test_the_glb_is_whole(demo: Path) -> None:
    data = (demo / "james.glb").read_bytes()
    assert data[:4] == b"glTF"
    assert int.from_bytes(data[8:12], "little") == len(data)


def test_units_of_the_pictures_exist() -> None:
    names = load_generic_head().unit_names
    assert all(unit in names for units in UNITS.values() for unit in units)


def run_without_work(mien: Mien, monkeypatch: pytest.MonkeyPatch, folder: Path) -> Ran:
    def refuse(*arguments: object, **options: object) -> None:
        raise AssertionError("the place is checked before the work")

    monkeypatch.setattr("mien.pipelines.demo.build_head_folder", refuse)
    return mien("demo", "-o", folder, "--json")


def test_a_foreign_folder_is_refused_and_untouched(
    mien: Mien,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    contents: Callable[[Path], dict[str, bytes]],
) -> None:
    (tmp_path / "index.html").write_text("my home page")
    error = run_without_work(mien, monkeypatch, tmp_path).error
    assert error.startswith(f"{tmp_path}: expected a new folder or one made by mien")
    assert contents(tmp_path) == {"index.html": b"my home page"}


def test_a_demo_that_fails_leaves_nothing(
    mien: Mien, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "demo"
    assert "internal error" in run_without_work(mien, monkeypatch, folder).error
    assert list(tmp_path.iterdir()) == []


def test_pages_ask_for_nothing_from_the_network(demo: Path) -> None:
    for page in (demo / "index.html", demo / "head" / "report.html"):
        assert not re.search(r"""(src|href)=["']?(https?:)?//""", page.read_text(encoding="utf-8"))
