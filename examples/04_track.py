"""The head in a video, followed frame by frame: as numbers, as pictures, and played again.

Usage: python examples/04_track.py [HEAD [VIDEO]]   (made by 01_build.py and 03_animate.py)
"""

import sys
from pathlib import Path

import numpy as np

from mien import TrackFiles, animate_head, load_head, load_track, track_video

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("example-head")
video = Path(sys.argv[2]) if len(sys.argv) > 2 else folder.with_name(f"{folder.name}-hello.mp4")
head = load_head(folder)

# Written once all frames are tracked; a run that is stopped goes on with resume=True.
table = folder.with_name(f"{folder.name}-track.csv")
tracked = track_video(video, head, TrackFiles(table, overlay=table.with_suffix(".mp4")))
print(f"{table}: {tracked}")
for note in tracked.notes:
    print("note:", note)

track = load_track(table)
for frame in track.frames[:: max(1, len(track.frames) // 4)]:
    if frame.state is None:
        print(f"{frame.time:.2f} s: lost")
        continue
    distance = np.linalg.norm(frame.state.t_cam_head)
    values = dict(zip(track.layout.channels, frame.state.values.tolist(), strict=True))
    name = max(values, key=lambda channel: abs(values[channel]))
    print(f"{frame.time:.2f} s: {distance:.0f} mm away, most of all {name} = {values[name]:.2f}")

# The performance without its video: any head with these expressions or units can give it.
take = animate_head(head, table, table.with_suffix(".glb"))
print(f"{table.with_suffix('.glb')}: {take.frames} frames")
