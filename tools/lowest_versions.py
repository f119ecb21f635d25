"""Constraints for pip: of every package that pyproject.toml asks for, the lowest version it admits.

python -m tools.lowest_versions > lowest.txt
pip install '.[test]' -c lowest.txt
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
_REQUIREMENT = re.compile(r"([\w.-]+)(?:\[[\w,-]+\])?(?:>=([\w.]+)(?:,<[\w.]+)?)?")


def lowest_versions(pyproject: str) -> list[str]:
    """`NAME==VERSION` of every dependency, those of the extra `test` too.

    Args:
        pyproject: the file's text.

    Raises:
        ValueError: a dependency without a lower bound, or written otherwise.
    """
    project = tomllib.loads(pyproject)["project"]
    asked = [*project["dependencies"]]
    for extra in ("usd", "test"):
        asked += project["optional-dependencies"][extra]
    found = []
    for requirement in asked:
        match = _REQUIREMENT.fullmatch(requirement)
        if match is None or not (match[2] or match[1] == project["name"]):
            raise ValueError(f"{requirement}: expected NAME>=VERSION or NAME>=VERSION,<VERSION")
        if match[2]:
            found.append(f"{match[1]}=={match[2]}")
    return found


if __name__ == "__main__":
    print(*lowest_versions(PYPROJECT.read_text(encoding="utf-8")), sep="\n")
