"""In a notebook: photos to a drawn head, a clip to a plotted curve, with `import mien` alone.

Usage: python examples/06_notebook.py [PHOTOS]   (without them the head that 01_build.py made or,
where there is none, the photos that come with mien)

Type `mien.` and TAB for what there is, and `help(mien.track_video)` for how it is used.
"""

import sys
from math import radians
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mien

folder = Path("example-head")
if len(sys.argv) == 1 and folder.is_dir():
    head = mien.load_head(folder)
else:
    photos = Path(sys.argv[1]) if len(sys.argv) > 1 else mien.capture.demo_photos()
    head = mien.build_head(photos).head

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 5), layout="constrained")
smile = mien.FaceState(units={"mouthSmileLeft": 0.7, "mouthSmileRight": 0.7})
left.imshow(mien.render_head(head, yaw=radians(25), state=smile, size=(400, 500)))
left.set_axis_off()

# A clip of the head itself, made of a few keys: seconds, and a face unit's weight or radians.
times = np.array([0.0, 0.6, 1.2])
curves = {
    "units.jawOpen": mien.animate.Curve(times, np.array([0.0, 0.6, 0.0])),
    "head.yaw": mien.animate.Curve(times, np.radians([-10.0, 0.0, 10.0])),
}
timeline = mien.Timeline(duration=1.2, fps=15, size=(320, 400), tracks=curves)
clip, table = Path("example-notebook.mp4"), Path("example-notebook.csv")
mien.animate_head(head, timeline, clip)

# The clip tracked; `series_of` gives a track's numbers as arrays, one value a frame.
print(mien.track_video(clip, head, mien.TrackFiles(table)))
series = mien.track.series_of(mien.load_track(table))
jaw, deviation = series.values["units.jawOpen"], series.deviations["units.jawOpen"]
right.fill_between(series.times, jaw - deviation, jaw + deviation, alpha=0.3)
right.plot(series.times, jaw, label="tracked")
right.plot(series.times, timeline.sample(series.times)["units.jawOpen"], "--", label="animated")
right.set(xlabel="seconds", ylabel="jawOpen")
right.legend()
figure.savefig("example-notebook.png")
print("look at example-notebook.png")
