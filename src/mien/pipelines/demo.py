"""`mien demo`: the main job on photos that ship with mien."""

from __future__ import annotations

import shutil
from importlib.resources import files
from math import radians
from pathlib import Path
from typing import TypedDict

from mien.animate.perform import sample_timeline
from mien.head import Head
from mien.io.files.atomic import atomic_folder, check_folder_place
from mien.io.files.image import save_image
from mien.io.head.head_folder import is_head_folder
from mien.io.mesh.export import export_head
from mien.pipelines.animate import animate_head
from mien.pipelines.build import TURNTABLE, build_head_folder
from mien.progress import Progress
from mien.render.picture import GREY, HeadRenderer, render_head
from mien.rig.state import FaceState


class _RenderOptions(TypedDict):
    size: tuple[int, int]
    background: tuple[int, int, int]


YAWS = {"front": 0, "left": -40, "left side": -90, "back": 180, "right side": 90, "right": 40}
UNITS = {
    "smile": {
        "mouthSmileLeft": 0.8,
        "mouthSmileRight": 0.8,
        "cheekSquintLeft": 0.5,
        "cheekSquintRight": 0.5,
    },
    "jaw open": {"jawOpen": 0.6},
    "blink": {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0},
    "brows up": {"browInnerUp": 1.0, "browOuterUpLeft": 0.8, "browOuterUpRight": 0.8},
}
_RENDER_OPTIONS = _RenderOptions(size=(480, 600), background=GREY)
PERFORMANCE = "performance.mp4"
_FPS = 25
_STAGE = "Rendering and exporting"


def demo_photos() -> Path:
    """The folder with the two photos that ship with mien, and their annotations."""
    return Path(str(files("mien.assets"))) / "data" / "james"


def run_demo(folder: Path, *, progress: Progress) -> Path:
    """Head, pictures, `.glb`, a performance and a page that shows them.

    Args:
        folder: to write.
        progress: called with the stage, steps done and their total.

    Returns:
        the page.

    Raises:
        InputError: the folder holds something else or cannot be written.
    """
    check_folder_place(folder, replaces=_is_demo)
    with atomic_folder(folder, replaces=_is_demo, editable=()) as temporary:
        head = build_head_folder(demo_photos(), temporary / "head", progress=progress).head
        pictures = _save_pictures(head, temporary, progress)
        export_head(head, temporary / "james.glb")
        progress(_STAGE, 2, 2)
        animate_head(
            head,
            sample_timeline(),
            temporary / PERFORMANCE,
            fps=_FPS,
            **_RENDER_OPTIONS,
            progress=progress,
        )
        shutil.copy(sample_timeline(), temporary)
        page = _page(head, pictures)
        (temporary / "index.html").write_text(page, encoding="utf-8")
    return folder / "index.html"


def _save_pictures(head: Head, folder: Path, progress: Progress) -> dict[str, list[dict[str, str]]]:
    """Save pictures of the head, turned and with face units; captions and file names by section."""
    progress(_STAGE, 0, 2)
    renderer = HeadRenderer(head)
    turned = {
        name: render_head(renderer, yaw=radians(yaw), **_RENDER_OPTIONS)
        for name, yaw in YAWS.items()
    }
    moved = {
        name: render_head(
            renderer, yaw=radians(-20), state=FaceState(units=units), **_RENDER_OPTIONS
        )
        for name, units in UNITS.items()
    }
    shown: dict[str, list[dict[str, str]]] = {}
    for section, pictures in {"turned": turned, "units": moved}.items():
        shown[section] = []
        for name, picture in pictures.items():
            file = f"pictures/{name.replace(' ', '_')}.jpg"
            save_image(folder / file, picture, quality=90)
            shown[section].append({"file": file, "caption": name})
    progress(_STAGE, 1, 2)
    return shown


def _page(head: Head, pictures: dict[str, list[dict[str, str]]]) -> str:
    from jinja2 import Environment, PackageLoader

    page = Environment(loader=PackageLoader("mien.pipelines", "."), autoescape=True)
    return page.get_template("demo.html.j2").render(
        photos=[view.photo for view in head.views],
        pictures=pictures,
        turntable=TURNTABLE,
        performance=PERFORMANCE,
    )


def _is_demo(folder: Path) -> bool:
    return (folder / "index.html").is_file() and is_head_folder(folder / "head")
