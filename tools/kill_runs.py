"""Kill mien's commands at random moments and look at what is left.

    python -m tools.kill_runs [-n 200] [--seed 1] [--only animate]

Six commands that write files and folders are run on a small head, each several times to its end, so
that the result to replace is there, and then again and again until a signal stops it: most often
SIGKILL, sometimes SIGTERM or SIGINT; half of the time as soon as something is being written. After
each the result must be whole: the old one or the new one, byte for byte (of videos, every frame).
After the next run that ends by itself nothing but the result may lie in the folder.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

from PIL import Image

from mien.pipelines.demo import demo_photos

SIGNALS = [signal.SIGKILL] * 6 + [signal.SIGTERM, signal.SIGINT]
TIMELINE = {
    "format": "mien timeline",
    "version": 1,
    "duration": 2.0,
    "fps": 15,
    "size": [240, 300],
    "tracks": {
        "head": {"yaw": [[0, -12], [1, 12], [2, -12]]},
        "units": {"jawOpen": [[0, 0], [0.7, 0.6], [2, 0]], "mouthSmileLeft": [[0, 0], [1.5, 0.8]]},
    },
}


@dataclass
class Case:
    """A command and what came of its kills.

    Attributes:
        name: of the command.
        arguments: but for the output.
        output: within a folder of its own.
        seconds: that an undisturbed run takes.
        whole: digests of results that runs wrote to their end.
        told: how often what happened.
    """

    name: str
    arguments: list[str]
    output: str
    seconds: float = 0.0
    whole: set[str] = field(default_factory=set)
    told: Counter[str] = field(default_factory=Counter)


def digest(path: Path) -> str:
    """Of a file, or of a folder's files and their names; "" where there is nothing.

    Of videos the frames are counted: their bytes differ from run to run (docs/reference/limits.md).
    """
    files = sorted(path.rglob("*")) if path.is_dir() else [path] if path.exists() else []
    hashed = sha256()
    for file in files:
        if file.is_file():
            content = frames_in(file) if file.suffix == ".mp4" else file.read_bytes()
            hashed.update(str(file.relative_to(path.parent)).encode() + content)
    return hashed.hexdigest() if files else ""


def frames_in(video: Path) -> bytes:
    """How many frames of a video can be decoded, as bytes; why not, where it is none."""
    import av

    try:
        with av.open(video) as container:
            return str(sum(1 for _ in container.decode(video=0))).encode()
    except av.FFmpegError as error:
        return str(error).encode()


def cases(place: Path) -> list[Case]:
    """The commands, on a head and a clip that are made here."""
    photos = place / "photos"
    photos.mkdir()
    for path in demo_photos().glob("*.png"):
        Image.open(path).convert("RGB").resize((375, 500)).save(photos / path.name)
    take = place / "take.json"
    take.write_text(json.dumps(TIMELINE))
    head, clip = place / "head", place / "clip.mp4"
    run("build", photos, "-o", head, "--texture-size", "128")
    run("animate", take, "--head", head, "-o", clip)
    small = [str(photos), "--texture-size", "64", "--no-dense"]
    return [
        Case("build", ["build", *small], "head"),
        Case("track", ["track", str(clip), "--head", str(head)], "t.csv"),
        Case("examples", ["examples", str(clip), "--count", "8"], "ex"),
        Case("animate", ["animate", str(take), "--head", str(head)], "take.mp4"),
        Case("frames", ["animate", str(take), "--head", str(head)], "frames/"),
        Case("export", ["export", str(head)], "head.glb"),
    ]


def run(*arguments: str | Path) -> None:
    """A command to its end. Raises: CalledProcessError."""
    command = [sys.executable, "-m", "mien", *map(str, arguments), "--json"]
    subprocess.run(command, check=True, capture_output=True)


def finish(case: Case, folder: Path) -> None:
    """A run to its end; what is left in the folder must be its result alone."""
    start = time.perf_counter()
    run(*case.arguments, "-o", f"{folder}/{case.output}")
    case.seconds = time.perf_counter() - start
    case.whole.add(digest(folder / case.output.rstrip("/")))
    results = {case.output.rstrip("/"), Path(case.output).with_suffix(".json").name}
    left = [path.name for path in folder.iterdir() if path.name not in results]
    case.told["left behind"] += len(left)


def kill(case: Case, folder: Path, rng: random.Random) -> None:
    """One run that is stopped, and a look at what it leaves."""
    command = [sys.executable, "-m", "mien", *case.arguments, "-o", f"{folder}/{case.output}"]
    before = set(folder.iterdir())
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        if rng.random() < 0.5:
            while process.poll() is None and set(folder.iterdir()) <= before:
                time.sleep(0.001)
            time.sleep(rng.random() * 0.2)
        else:
            time.sleep(rng.random() * case.seconds)
        ended = process.poll() is not None
        process.send_signal(rng.choice(SIGNALS))
    if ended:
        case.whole.add(digest(folder / case.output.rstrip("/")))
    found = digest(folder / case.output.rstrip("/"))
    case.told["ended before" if ended else "killed"] += 1
    case.told["spoilt"] += found not in case.whole


@contextmanager
def scratch() -> Iterator[Path]:
    place = Path(tempfile.mkdtemp())
    try:
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)


def table(rows: list[Case]) -> str:
    """As Markdown."""
    lines = [
        "| command | killed | results spoilt | files left behind after the next run |",
        "|---|---|---|---|",
    ]
    columns = ("killed", "spoilt", "left behind")
    for case in rows:
        lines.append(f"| {case.name} | {' | '.join(str(case.told[what]) for what in columns)} |")
    total = (sum(case.told[what] for case in rows) for what in columns)
    return "\n".join([*lines, f"| all | {' | '.join(map(str, total))} |"])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=200, help="kills in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="one of the commands alone")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with scratch() as place:
        rows = [case for case in cases(place) if options.only in (None, case.name)]
        for case in rows:
            folder = place / f"out-{case.name}"
            folder.mkdir()
            finish(case, folder)
            while case.told["killed"] < -(-options.n // len(rows)):
                kill(case, folder, rng)
                if not case.told["killed"] % 5:
                    finish(case, folder)
            finish(case, folder)
            print(f"{case.name}: {dict(case.told)}", file=sys.stderr, flush=True)
    print(table(rows))
    return int(any(case.told["spoilt"] or case.told["left behind"] for case in rows))


if __name__ == "__main__":
    sys.exit(main())
