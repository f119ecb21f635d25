"""What the documentation names exists: modules, names, files; and every public name has a page."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest
from tools.docs_site import api_pages, public_names

ROOT = Path(__file__).parents[1]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]
IMPORT = re.compile(r"^from (mien[\w.]*) import ([\w, ]+)$", re.MULTILINE)
DOTTED = re.compile(r"`(mien(?:\.\w+)+)`")
FILE = re.compile(
    r"(?<![\w/])(?:src/mien|tests|tools|benchmarks|examples)/[\w/.-]+\.(?:py|md|json)"
)


def exists(dotted: str) -> bool:
    """Whether a dotted name is a module or what can be reached in one."""
    module, _, name = dotted.rpartition(".")
    try:
        import_module(dotted)
        return True
    except ModuleNotFoundError:
        return bool(module) and exists(module) and hasattr(import_module(module), name)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_a_page_names_exists(page: Path) -> None:
    if page.name == "CHANGELOG.md":
        return  # it tells of what was, too
    text = page.read_text(encoding="utf-8")
    named = {
        f"{module}.{name.strip()}"
        for module, names in IMPORT.findall(text)
        for name in names.split(",")
    }
    named |= set(DOTTED.findall(text))
    assert [name for name in sorted(named) if not exists(name)] == []
    assert [file for file in sorted(set(FILE.findall(text))) if not (ROOT / file).exists()] == []


def test_a_name_that_is_gone_is_noticed() -> None:
    assert exists("mien.track.track_video")
    assert not exists("mien.track.tracked_video")
    assert not exists("mien.tracks")


def test_every_public_name_has_a_page() -> None:
    pages = api_pages()
    for space, names in public_names().items():
        assert names, space
        index = pages[f"reference/api/{space}/index.md"]
        for name in names:
            assert f"[`{name}`](" in index
    targets = {path.removeprefix("reference/api/") for path in pages}
    links = {link for text in pages.values() for link in re.findall(r"\]\(\.\./([^)]+)\)", text)}
    assert links <= targets


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_and_pictures_of_a_page_exist(page: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)[^)\s]*\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if "://" not in link and not (page.parent / link).exists()] == []


def test_every_picture_is_on_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    pictures = sorted((ROOT / "docs" / "images").iterdir())
    assert [picture.name for picture in pictures if f"images/{picture.name}" not in text] == []


def test_words_of_our_own_are_few() -> None:
    glossary = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")
    assert 0 < len(re.findall(r"^\| \*\*", glossary, re.MULTILINE)) <= 25
