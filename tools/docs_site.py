"""What the documentation's site has beyond docs/: the public names, measured tables, citations.

mkdocs calls the functions named `on_...` (`hooks` in mkdocs.yml). Each public name gets a page made
of its docstring. The pages of benchmarks/ become pages of the site, so links to them work there as
well as where the repository is browsed. `[Pighin 2002]` and `[Zhang 2006]` become links, also in
docstrings.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from posixpath import relpath
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "mien"
NAMESPACES = (
    "mien",
    *sorted(f"mien.{stub.parent.name}" for stub in PACKAGE.glob("*/__init__.pyi")),
)
_CITATION = re.compile(r"\[(Pighin|Zhang) (2002|2006)\]")


def public_names() -> dict[str, list[str]]:
    """The names that each namespace exports, in its own order; modules are left out."""
    return {
        space: [
            name
            for name in getattr(import_module(space), "__all__", ())
            if not isinstance(_public(space, name), ModuleType)
        ]
        for space in NAMESPACES
    }


def api_pages() -> dict[str, str]:
    """Markdown by path in docs/: one page for each public name, one index for each namespace.

    What several namespaces export has its page where it comes first.
    """
    pages: dict[str, str] = {}
    homes: dict[int, str] = {}
    for space, names in public_names().items():
        rows = []
        for name in names:
            item = _public(space, name)
            home = homes.setdefault(id(item), space)
            if home == space:
                pages[f"reference/api/{space}/{name}.md"] = f"::: {space}.{name}\n"
            rows.append(f"| [`{name}`](../{home}/{name}.md) | {_summary(item)} |\n")
        if rows:
            about = _summary(import_module(space))
            head = f"# {space}\n\n{about}\n\n| name | what it is |\n| --- | --- |\n"
            pages[f"reference/api/{space}/index.md"] = head + "".join(rows)
    return pages


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Adds the public names to the navigation under Reference, the measured tables under Notes."""
    sections: dict[str, list[Any]] = {}
    for path in api_pages():
        space = path.split("/")[2]
        entry = path if path.endswith("index.md") else {Path(path).stem: path}
        sections.setdefault(space, []).append(entry)
    for pages in sections.values():
        pages.insert(0, pages.pop())  # the index
    assert config.nav is not None
    parts = {
        name: pages for part in config.nav if isinstance(part, dict) for name, pages in part.items()
    }
    parts["Reference"].append({"Python": [{space: pages} for space, pages in sections.items()]})
    parts["Notes"].append({"Benchmarks": list(_benchmark_pages())})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages that are not files of docs/."""
    from mkdocs.structure.files import File

    texts = api_pages()
    texts |= {uri: (ROOT / uri).read_text("utf-8") for uri in _benchmark_pages()}
    for path, text in texts.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links between docs/ and benchmarks/, which lie beside each other on the site."""
    if page.file.src_uri.startswith("benchmarks/"):
        return markdown.replace("](../docs/", "](../")
    return markdown.replace("](../../benchmarks/", "](../benchmarks/")


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links citations to the page of the papers."""
    target = relpath("reference/papers.html", str(Path(page.file.dest_uri).parent))
    return _CITATION.sub(
        lambda found: (
            f'<a href="{target}#{found[1].lower()}-{found[2]}">[{found[1]} {found[2]}]</a>'
        ),
        html,
    )


def _public(space: str, name: str) -> Any:
    return getattr(import_module(space), name)


def _summary(item: Any) -> str:
    return (inspect.getdoc(item) or "").split("\n\n")[0].replace("\n", " ").replace("|", "\\|")


def _benchmark_pages() -> Iterator[str]:
    """Their paths in the repository, which are those on the site."""
    yield "benchmarks/README.md"
    for path in sorted((ROOT / "benchmarks" / "results").glob("*.md")):
        yield path.relative_to(ROOT).as_posix()
