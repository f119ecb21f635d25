"""A head says hello: a timeline written by a script, as a video and as a model that moves.

Usage: python examples/03_animate.py [HEAD]   (made by 01_build.py)
"""

import json
import sys
from math import radians
from pathlib import Path
from typing import Any

from mien import animate_head, load_head
from mien.animate import load_timeline

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("example-head")
head = load_head(folder)

# Times in seconds, angles in degrees; see docs/reference/timeline.md.
tracks: dict[str, Any] = {
    "head": {"yaw": [[0, 0], [0.8, 15], [2, 0]], "pitch": [[0.8, 0], [1.1, 6], [1.5, 0]]},
    "gaze": {"yaw": [[0.2, 0], [0.3, -10], [1.4, 0]]},
    "units": {"mouthSmileLeft": [[0, 0], [0.9, 0.7], [2, 0]], "jawOpen": [[0, 0.1], [2, 0]]},
}
# Photographed expressions, where the head has any, mix in one region or in the whole face.
for name in [name for name in head.expressions if name != "neutral"][:1]:
    tracks["mouth"] = {name: [[0.5, 0], [1.2, 0.8], [2, 0]]}
document = {
    "format": "mien timeline",
    "version": 1,
    "duration": 2,
    "fps": 12,
    "size": [320, 400],
    "tracks": tracks,
    "layers": [{"generator": "blink", "period": 1.5, "seed": 1}],
}

path = folder.with_name(f"{folder.name}-hello.json")
path.write_text(json.dumps(document, indent=2), encoding="utf-8")
timeline = load_timeline(path)
for suffix in (".mp4", ".glb", ".csv"):
    take = animate_head(head, timeline, path.with_suffix(suffix), yaw=radians(-10))
    print(f"{path.with_suffix(suffix)}: {take.frames} frames")
    for note in take.notes:
        print("note:", note)
