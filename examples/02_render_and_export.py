"""Turn a head, open its mouth, and hand it to Blender.

Usage: python examples/02_render_and_export.py [HEAD]   (made by 01_build.py)
"""

import sys
from math import radians
from pathlib import Path

from mien import FaceState, export_head, load_head, render_head
from mien.io import save_image

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("example-head")
head = load_head(folder)

state = FaceState(units={"jawOpen": 0.3, "mouthSmileLeft": 0.6})
for yaw in (-40, 0, 40):
    picture = render_head(head, yaw=radians(yaw), state=state)
    save_image(folder.with_name(f"{folder.name}-{yaw}.png"), picture)
export_head(head, folder.with_suffix(".glb"))
