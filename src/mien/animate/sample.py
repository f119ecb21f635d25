"""The timeline that ships with mien; it has only units, so that it fits any head."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

SAMPLE_TIMELINE = Path(str(files("mien.assets"))) / "data" / "sample_timeline.json"
"""Ten seconds: a silent sentence, a look around, a smile, raised brows; blinking and breathing."""
