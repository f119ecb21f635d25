"""PNG sequences: exact, whole or not at all, never over other things."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mien.errors import InputError
from mien.io.files.frames import check_frames_place, save_frames


def pictures(count: int, channels: int = 4) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return list(rng.integers(0, 256, (count, 9, 7, channels), np.uint8))


@pytest.mark.parametrize("channels", [3, 4])
def test_pictures_round_trip_exactly(tmp_path: Path, channels: int) -> None:
    given = pictures(3, channels)
    assert save_frames(tmp_path / "out", iter(given), name="james") == 3
    files = sorted((tmp_path / "out").iterdir())
    assert [file.name for file in files] == [f"james_{i:06}.png" for i in range(3)]
    for file, picture in zip(files, given, strict=True):
        with Image.open(file) as image:
            np.testing.assert_array_equal(np.asarray(image), picture)


def test_a_shorter_run_leaves_no_old_pictures(tmp_path: Path) -> None:
    save_frames(tmp_path / "out", pictures(5))
    save_frames(tmp_path / "out", pictures(2))
    assert len(list((tmp_path / "out").iterdir())) == 2


def test_a_run_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    save_frames(tmp_path / "out", pictures(5))
    before = sorted(file.read_bytes() for file in (tmp_path / "out").iterdir())
    with pytest.raises(InputError, match=r"frame 2: expected shape \(9, 7, 4\) as the first"):
        save_frames(tmp_path / "out", [*pictures(2), np.zeros((9, 8, 4), np.uint8)])
    assert sorted(file.read_bytes() for file in (tmp_path / "out").iterdir()) == before
    assert [item.name for item in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("other", ["notes.txt", "frame_000001.jpg", "other_000000.png", "f.png"])
def test_a_folder_with_other_things_is_left_alone(tmp_path: Path, other: str) -> None:
    save_frames(tmp_path / "out", pictures(1))
    (tmp_path / "out" / other).write_text("mine")
    with pytest.raises(InputError, match="a folder with other things in it"):
        check_frames_place(tmp_path / "out")
    with pytest.raises(InputError, match="a folder with other things in it"):
        save_frames(tmp_path / "out", pictures(1))
    assert (tmp_path / "out" / other).read_text() == "mine"


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least one frame to write"):
        save_frames(tmp_path / "out", [])
    with pytest.raises(InputError, match="name: expected letters"):
        save_frames(tmp_path / "out", pictures(1), name="../x")
    assert not list(tmp_path.iterdir())


def test_numbered_pictures_of_others_are_left_alone(tmp_path: Path) -> None:
    """Of the same kind of name; also one of ours that a painter has saved again."""
    (tmp_path / "out").mkdir()
    own = tmp_path / "out" / "holiday_000001.png"
    Image.fromarray(pictures(1)[0]).save(own)
    before = own.read_bytes()
    with pytest.raises(InputError, match="a folder with other things in it"):
        check_frames_place(tmp_path / "out")
    assert own.read_bytes() == before
    save_frames(tmp_path / "drawn", pictures(2))
    with Image.open(tmp_path / "drawn" / "frame_000001.png") as image:
        image.load()
    image.info.clear()
    image.save(tmp_path / "drawn" / "frame_000001.png")
    with pytest.raises(InputError, match="a folder with other things in it"):
        save_frames(tmp_path / "drawn", pictures(2))


def test_frames_are_not_made_over_what_they_are_made_from(tmp_path: Path) -> None:
    save_frames(tmp_path / "out", pictures(1))
    with pytest.raises(InputError, match="a folder that nothing is read from"):
        check_frames_place(tmp_path / "out", read=[tmp_path / "out" / "take.json"])


def test_what_file_managers_leave_is_no_other_thing(tmp_path: Path) -> None:
    for _ in range(2):
        assert save_frames(tmp_path / "out", pictures(2)) == 2
        assert not (tmp_path / "out" / ".DS_Store").exists()
        (tmp_path / "out" / ".DS_Store").write_bytes(b"view")
