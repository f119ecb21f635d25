from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from mien.errors import InputError
from mien.io.files.atomic import (
    atomic_file,
    atomic_folder,
    check_file_place,
    check_files_apart,
    check_folder_place,
)


def always(folder: Path) -> bool:
    return True


def never(folder: Path) -> bool:
    return False


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class TestFile:
    def test_appears_at_the_end(self, tmp_path: Path) -> None:
        target = tmp_path / "new" / "folders" / "result.txt"
        with atomic_file(target) as temporary:
            temporary.write_text("whole")
            assert temporary.parent == target.parent, "so that the rename stays on one disk"
            assert not target.exists()
        assert target.read_text() == "whole"
        assert names(target.parent) == ["result.txt"]

    @pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt])
    def test_a_failure_leaves_the_old_one(self, tmp_path: Path, stop: type) -> None:
        target = tmp_path / "result.txt"
        target.write_text("old")

        def write_half() -> None:
            with atomic_file(target) as temporary:
                temporary.write_text("half")
                raise stop

        with pytest.raises(stop):
            write_half()
        assert target.read_text() == "old"
        assert names(tmp_path) == ["result.txt"]

    def test_has_the_permissions_of_any_new_file(self, tmp_path: Path) -> None:
        with atomic_file(tmp_path / "a") as temporary:
            temporary.write_text("")
        (tmp_path / "b").write_text("")
        assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode

    def test_a_link_stays_and_what_it_names_is_replaced(self, tmp_path: Path) -> None:
        (tmp_path / "real").write_text("old")
        (tmp_path / "link").symlink_to(tmp_path / "real")
        with atomic_file(tmp_path / "link") as temporary:
            temporary.write_text("new")
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "real").read_text() == "new"

    def test_refuses_a_folder(self, tmp_path: Path) -> None:
        with (
            pytest.raises(InputError, match="expected a file's name, got a folder"),
            atomic_file(tmp_path),
        ):
            pass

    def test_refuses_a_device(self) -> None:
        with (
            pytest.raises(InputError, match="/dev/null: expected a file's name, got a device"),
            atomic_file("/dev/null"),
        ):
            pass

    def test_a_file_where_a_folder_should_be(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        with (
            pytest.raises(
                InputError, match=r"result: expected a place that can be written to, got"
            ),
            atomic_file(tmp_path / "file" / "result"),
        ):
            pass

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
    def test_a_read_only_folder(self, tmp_path: Path) -> None:
        tmp_path.chmod(0o500)
        with pytest.raises(InputError, match="Permission denied"), atomic_file(tmp_path / "x"):
            pass

    def test_a_full_disk_while_writing(self, tmp_path: Path) -> None:
        target = tmp_path / "result.txt"
        target.write_text("old")
        with (
            pytest.raises(InputError, match=r"result\.txt: .*, got No space left on device"),
            atomic_file(target),
        ):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        assert target.read_text() == "old"
        assert names(tmp_path) == ["result.txt"]

    def test_a_place_is_checked_and_left_as_it_was(self, tmp_path: Path) -> None:
        (tmp_path / "old").write_text("old")
        for name in ("old", "new"):
            check_file_place(tmp_path / name)
        assert names(tmp_path) == ["old"]
        assert (tmp_path / "old").read_text() == "old"
        check_file_place(tmp_path / "folders" / "above" / "new")
        check_folder_place(tmp_path / "folders" / "above" / "new", replaces=lambda folder: True)
        assert names(tmp_path) == ["old"]
        with pytest.raises(InputError, match="expected a file's name, got a folder"):
            check_file_place(tmp_path)
        with pytest.raises(InputError, match="expected a place that can be written to, got"):
            check_file_place(tmp_path / "old" / "below")

    @pytest.mark.parametrize("name", ["new", "folders/above/new"])
    def test_a_place_that_cannot_be_written_is_found_before_the_work(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        def refused(path: Path, **options: bool) -> None:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

        monkeypatch.setattr(Path, "touch", refused)
        message = f"{name}: expected a place that can be written to, got Permission denied"
        with pytest.raises(InputError, match=message):
            check_file_place(tmp_path / name)
        with pytest.raises(InputError, match=message):
            check_folder_place(tmp_path / name, replaces=lambda folder: True)

    def test_what_is_read_is_not_written_over(self, tmp_path: Path) -> None:
        photo, picture = tmp_path / "a.jpg", tmp_path / "b.png"
        photo.write_text("photo")
        (tmp_path / "link.jpg").symlink_to(photo)
        check_files_apart([picture, tmp_path / "W.json"], [photo])
        for written in ([photo], [tmp_path / "link.jpg"], [picture, tmp_path / "." / "b.png"]):
            with pytest.raises(InputError, match="expected a place of its own, got a file that is"):
                check_files_apart(written, [photo])

    def test_errors_of_other_files_pass_through(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError), atomic_file(tmp_path / "result"):
            (tmp_path / "absent").read_text()
        refused = PermissionError(errno.EACCES, "Permission denied", "/photos/front.jpg")
        with pytest.raises(PermissionError), atomic_file(tmp_path / "result"):
            raise refused


class TestFolder:
    def test_appears_at_the_end(self, tmp_path: Path) -> None:
        target = tmp_path / "above" / "result"
        with atomic_folder(target, replaces=never) as temporary:
            (temporary / "a").write_text("1")
            assert not target.exists()
        assert names(target) == ["a"]
        assert names(target.parent) == ["result"]

    def test_takes_the_place_of_the_old_one_whole(self, tmp_path: Path) -> None:
        target = tmp_path / "result"
        target.mkdir()
        (target / "old").write_text("")
        with atomic_folder(target, replaces=always) as temporary:
            (temporary / "new").write_text("")
            assert names(target) == ["old"]
        assert names(target) == ["new"]
        assert names(tmp_path) == ["result"]

    @pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt])
    def test_a_failure_leaves_the_old_one(self, tmp_path: Path, stop: type) -> None:
        target = tmp_path / "result"
        target.mkdir()
        (target / "old").write_text("kept")

        def write_half() -> None:
            with atomic_folder(target, replaces=always) as temporary:
                (temporary / "old").write_text("half")
                raise stop

        with pytest.raises(stop):
            write_half()
        assert (target / "old").read_text() == "kept"
        assert names(tmp_path) == ["result"]

    def test_a_failure_between_the_renames_puts_the_old_one_back(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        target = tmp_path / "result"
        target.mkdir()
        (target / "old").write_text("kept")
        rename = Path.rename

        def fails_for_the_new(source: Path, destination: Path) -> Path:
            if source.suffix == ".tmp":
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return rename(source, destination)

        monkeypatch.setattr(Path, "rename", fails_for_the_new)
        with (
            pytest.raises(InputError, match="No space left"),
            atomic_folder(target, replaces=always),
        ):
            pass
        assert names(target) == ["old"]
        assert names(tmp_path) == ["result"]

    def test_refuses_a_folder_with_other_things(self, tmp_path: Path) -> None:
        (tmp_path / "mine").write_text("")
        for refuse in (
            lambda: check_folder_place(tmp_path, replaces=never),
            lambda: atomic_folder(tmp_path, replaces=never).__enter__(),
        ):
            with pytest.raises(InputError, match="got a folder with other things in it"):
                refuse()
        assert names(tmp_path) == ["mine"]

    def test_an_empty_folder_may_be_replaced(self, tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        with atomic_folder(tmp_path / "empty", replaces=never) as temporary:
            (temporary / "a").write_text("")
        assert names(tmp_path / "empty") == ["a"]

    def test_refuses_a_file(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        with pytest.raises(InputError, match="expected a folder's name, got a file of that name"):
            check_folder_place(tmp_path / "file", replaces=always)

    def test_refuses_a_place_below_a_file(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        with (
            pytest.raises(InputError, match="expected a place that can be written to"),
            atomic_folder(tmp_path / "file" / "result", replaces=always),
        ):
            pass


@pytest.mark.parametrize("name", ["", "a\0b"])
def test_names_that_are_none(name: str) -> None:
    for check in (check_file_place, lambda name: check_folder_place(name, replaces=always)):
        with pytest.raises(InputError, match="expected where a result goes, got a"):
            check(name)
