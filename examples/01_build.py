"""Photos to a head folder, from Python.

Usage: python examples/01_build.py [PHOTOS] [HEAD]
"""

import sys
from pathlib import Path

from mien.capture import demo_photos
from mien.reconstruction import build_head_folder

photos = Path(sys.argv[1]) if len(sys.argv) > 1 else demo_photos()
folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("example-head")

result = build_head_folder(photos, folder)
for view in result.head.views:
    print(f"{view.photo}: focal length {view.camera.focal_px:.0f} px, RMS {view.rms_px:.1f} px")
for note in result.notes:
    print("note:", note)
print("look at", folder / "report.html")
