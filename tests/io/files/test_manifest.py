"""A folder that is replaced keeps what mien did not write."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

from mien.errors import InputError
from mien.io.files import atomic
from mien.io.files.atomic import atomic_folder, check_files_apart, check_side_file
from mien.io.files.manifest import MANIFEST, kept_notes, load_manifest, user_files


def always(folder: Path) -> bool:
    return True


def write(folder: Path, files: Mapping[str, str], editable: tuple[str, ...] = ()) -> None:
    with atomic_folder(folder, replaces=always, editable=editable) as place:
        for name, text in files.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_text(text)


def contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != MANIFEST)
    return {path.relative_to(folder).as_posix(): path.read_text() for path in files}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    write(tmp_path / "made", {"a": "1", "deep/b": "2", "old": "3"})
    return tmp_path / "made"


def test_all_of_a_new_folder_is_miens(place: Path) -> None:
    manifest = load_manifest(place)
    assert manifest is not None
    assert set(manifest.files) == {"a", "deep/b", "old"}
    assert user_files(place) == []
    assert kept_notes(place) == ()


def test_what_mien_wrote_goes_and_what_others_wrote_stays(place: Path) -> None:
    (place / "notes").write_text("mine")
    (place / "deep" / "more").write_text("mine, too")
    write(place, {"a": "new"})
    assert contents(place) == {"a": "new", "notes": "mine", "deep/more": "mine, too"}
    note = f"{place}: kept, as mien did not write it: notes, deep/more"
    assert kept_notes(place) == (note,)


def test_what_somebody_changed_is_set_aside(place: Path) -> None:
    (place / "deep" / "b").write_text("changed")
    (place / "old").write_text("4")  # of the same size
    for number in ("5", "6"):
        write(place, {"a": number, "deep/b": number})
        assert contents(place) == {
            "a": number,
            "deep/b": number,
            "kept/deep/b": "changed",
            "kept/old": "4",
        }


def test_nothing_kept_is_overwritten_by_the_next(place: Path) -> None:
    for text in ("first", "second", "third"):
        (place / "a").write_text(text)
        write(place, {"a": "new"})
    assert contents(place) == {
        "a": "new",
        "kept/a": "first",
        "kept/a-2": "second",
        "kept/a-3": "third",
    }


def test_what_comes_while_the_new_folder_is_brought_to_the_disk(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place / "notes").write_text("mine")
    brought = atomic._tree_to_disk

    def disturbed(folder: Path) -> None:
        brought(folder)
        (place / "late").write_text("mine, too")
        (place / "other").write_text("saved anew")
        (place / "other").replace(place / "notes")
        (place / "a").write_text("changed")

    monkeypatch.setattr(atomic, "_tree_to_disk", disturbed)
    write(place, {"a": "new"})
    assert contents(place) == {
        "a": "new",
        "notes": "mine",
        "late": "mine, too",
        "kept/notes": "saved anew",
        "kept/a": "changed",
    }


def test_another_run_that_is_done_first_leaves_nothing_to_keep(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    brought = atomic._tree_to_disk

    def disturbed(folder: Path) -> None:
        monkeypatch.undo()
        write(place, {"a": "theirs", "b": "theirs"})
        brought(folder)

    monkeypatch.setattr(atomic, "_tree_to_disk", disturbed)
    write(place, {"a": "new"})
    assert contents(place) == {"a": "new"}


def test_other_things_that_come_during_the_run(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()

    def nothing(folder: Path) -> bool:
        return False

    def run() -> None:
        with atomic_folder(tmp_path / "new", replaces=nothing) as folder:
            (folder / "a").write_text("1")
            (tmp_path / "new" / "notes").write_text("mine")

    with pytest.raises(InputError, match="a folder with other things in it"):
        run()
    assert (tmp_path / "new" / "notes").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def test_a_name_that_the_new_folder_needs(place: Path) -> None:
    (place / "c").write_text("mine")
    write(place, {"c": "new"})
    assert contents(place) == {"c": "new", "kept/c": "mine"}


def test_folders_and_files_that_stand_in_the_way_of_each_other(place: Path) -> None:
    (place / "old").unlink()
    for folder in ("a", "old"):
        (place / folder).unlink(missing_ok=True)
        (place / folder).mkdir()
        (place / folder / "mine").write_text("mine")
    (place / "deep" / "b").unlink()
    (place / "deep").rmdir()
    (place / "deep").write_text("no folder")
    for _ in range(2):
        write(place, {"a": "new", "deep/b": "new"})
        assert contents(place) == {
            "a": "new",
            "deep/b": "new",
            "old/mine": "mine",
            "kept/a/mine": "mine",
            "kept/deep": "no folder",
        }


@pytest.mark.parametrize("link", [False, True])
def test_a_file_that_is_called_kept(place: Path, link: bool) -> None:
    if link and os.name == "nt":
        pytest.skip("links want a privilege there")
    if link:
        (place / "kept").symlink_to("nowhere")
    else:
        (place / "kept").write_text("mine")
    (place / "a").write_text("changed")
    write(place, {"a": "new"})
    assert (place / "kept").is_symlink() == link
    found = contents(place)
    assert found.pop("kept", "mine") == "mine"
    assert found == {"a": "new", "kept-2/a": "changed"}


def test_a_folder_with_the_name_of_the_list(place: Path) -> None:
    (place / MANIFEST).unlink()
    (place / MANIFEST).mkdir()
    (place / MANIFEST / "x").write_text("mine")
    write(place, {"a": "new", "deep/b": "new", "old": "new"})
    assert load_manifest(place) is not None
    assert (place / "kept" / MANIFEST / "x").read_text() == "mine"


def test_empty_folders_stay(place: Path) -> None:
    (place / "mine" / "empty").mkdir(parents=True)
    write(place, {"a": "new"})
    assert (place / "mine" / "empty").is_dir()
    assert not (place / "deep").exists()


def test_editable_files_stay(place: Path) -> None:
    (place / "a").write_text("painted")
    for _ in range(2):
        write(place, {"a": "1", "deep/b": "2"}, editable=("a",))
        assert contents(place) == {"a": "painted", "deep/b": "2"}


@pytest.mark.parametrize("damage", ["", "{", '{"format": "x"}', '{"files": [1]}', "absent"])
def test_without_a_manifest_no_file_counts_as_miens(place: Path, damage: str) -> None:
    if damage == "absent":
        (place / MANIFEST).unlink()
    else:
        (place / MANIFEST).write_text(damage)
    write(place, {"a": "new"})
    assert contents(place) == {"a": "new", "deep/b": "2", "old": "3", "kept/a": "1"}


@pytest.mark.skipif(os.name == "nt", reason="links want a privilege there")
def test_links_stay_links(place: Path, tmp_path: Path) -> None:
    (tmp_path / "clips").mkdir()
    (tmp_path / "clips" / "long.mp4").write_text("film")
    (place / "clips").symlink_to(tmp_path / "clips")
    (place / "gone").symlink_to(tmp_path / "nowhere")
    os.mkfifo(place / "pipe")
    write(place, {"a": "new"})
    assert (place / "clips").is_symlink()
    assert (place / "clips" / "long.mp4").read_text() == "film"
    assert (place / "gone").is_symlink()
    assert (place / "pipe").is_fifo()


def test_a_failure_leaves_all_as_it_was(place: Path) -> None:
    (place / "notes").write_text("mine")
    before = contents(place)

    def fail() -> None:
        with atomic_folder(place, replaces=always, editable=()) as new:
            (new / "a").write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert contents(place) == before
    assert [path.name for path in place.parent.iterdir()] == ["made"]


class TestWhatIsRead:
    @pytest.mark.skipif(os.name == "nt", reason="links want a privilege there")
    @pytest.mark.parametrize("name", ["b.jpg", "joy/b.jpg", "joy"])
    def test_a_source_with_links_into_the_folder(
        self, place: Path, tmp_path: Path, name: str
    ) -> None:
        link = tmp_path / "photos" / name
        link.parent.mkdir(parents=True)
        link.symlink_to(place / "deep" / "b")
        message = f"a folder that nothing is read from, got one with {link}"
        with (
            pytest.raises(InputError, match=message),
            atomic_folder(place, replaces=always, read=[tmp_path / "photos"]),
        ):
            pass

    def test_a_source_in_the_folder(self, place: Path) -> None:
        (place / "mine").mkdir()
        for source in (place, place / "mine", place / "notes.txt"):
            with (
                pytest.raises(InputError, match="a folder that nothing is read from, got"),
                atomic_folder(place, replaces=always, read=[source]),
            ):
                pass
        with atomic_folder(place, replaces=always, read=[place.parent, place.parent / "made2"]):
            pass

    def test_a_file_of_a_folder_that_is_read(self, place: Path) -> None:
        for name in ("a", "deep/b", "deep/../a"):
            with pytest.raises(InputError, match=r"of its own, got a file of .*made, which"):
                check_files_apart([place / name], [place])
        (place / "picture.png").write_text("of an earlier run")
        check_files_apart([place / "picture.png", place / "new.png", place.parent / "a"], [place])

    def test_all_files_of_a_folder_without_a_list(self, place: Path) -> None:
        (place / MANIFEST).unlink()
        with pytest.raises(InputError, match="got a file of"):
            check_files_apart([place / "a"], [place])
        check_files_apart([place / "new"], [place])

    @pytest.mark.skipif(os.name == "nt", reason="links want a privilege there")
    def test_other_names_of_the_same_file(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("")
        os.link(tmp_path / "a", tmp_path / "hard")
        (tmp_path / "soft").symlink_to("a")
        (tmp_path / "up").symlink_to(".")
        for name in ("hard", "soft", "up/a"):
            with pytest.raises(InputError, match="got a file that is read or written as well"):
                check_files_apart([tmp_path / name], [tmp_path / "a"])

    def test_what_a_result_brings_along(self, tmp_path: Path) -> None:
        picture, model = tmp_path / "face.png", tmp_path / "face.obj"
        check_side_file(picture, model)
        picture.write_text("mine")
        with pytest.raises(InputError, match=r"face\.png: expected a free place for what goes"):
            check_side_file(picture, model)
        model.write_text("of the last run")
        check_side_file(picture, model)
