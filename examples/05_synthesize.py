"""An expression that no picture shows: examples, a few points moved, and the picture that follows.

Usage: python examples/05_synthesize.py [SOURCE]   (a video or a folder of photos of one person;
without one, photos are taken of the head that 01_build.py made)
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from mien import FaceState, gather_examples, load_examples, load_head
from mien.io import save_examples
from mien.render import HeadRenderer
from mien.synthesis import Synthesizer

source = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("example-photos")
folder = source.with_name(f"{source.stem}-examples")

if len(sys.argv) < 2:
    # What an actor would do before a camera: a face at rest, and some two dozen others.
    source.mkdir(exist_ok=True)
    renderer = HeadRenderer(load_head(Path("example-head")))
    camera = renderer.camera(size=(400, 500))
    rng = np.random.default_rng(6)
    for number in range(24):
        smile, frown, raised, jaw = rng.uniform(0, 0.9, 4) * rng.integers(0, 2, 4) * (number > 0)
        units = {
            **{f"mouthSmile{side}": smile for side in ("Left", "Right")},
            **{f"browDown{side}": frown for side in ("Left", "Right")},
            **{f"browOuterUp{side}": raised for side in ("Left", "Right")},
            "browInnerUp": raised,
            "jawOpen": 0.6 * jaw,
        }
        picture = renderer.draw(FaceState(units=units), camera, background=(96, 96, 104))
        Image.fromarray(picture[..., :3]).save(source / f"take_{number:02}.png")

# The pictures that differ most become examples; all give the statistics of the points.
gathered = gather_examples(source)
save_examples(folder, gathered.examples, why=gathered.why)
for note in gathered.notes:
    print("note:", note)

examples = load_examples(folder)
layout, neutral = examples.layout, examples.neutral.points
synthesizer = Synthesizer(examples)

# Corners of the mouth go up and out by a fortieth of the face; all other points follow, and then
# the picture, every subregion from the examples that come nearest to it.
step = np.ptp(neutral[:, 0]) / 40
shifts = {"right_mouth_corner": [-step, -step], "left_mouth_corner": [step, -step]}
corners = {name: neutral[layout.index(name)] + shift for name, shift in shifts.items()}
points = synthesizer.complete(corners, head="still")
made = synthesizer.synthesize(points)

path = folder.with_suffix(".png")
Image.fromarray(made.image).save(path)
lips = made.coefficients[examples.subregions.names.index("lips")]
for row in np.argsort(-lips)[:3]:
    print(f"the lips are {lips[row]:.0%} {examples.examples[row].source}")
print("look at", path)
