"""Heads to write and read, and the Khronos validator."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.head import Expression, FittedView, Head, Verdict
from mien.io.mesh.head_animation import HeadAnimation
from mien.mesh import Mesh
from mien.numeric.rotation import rotation_from_vector

HERE = Path(__file__).parent
COLUMNS, ROWS = 12, 7


@pytest.fixture
def gltf_remarks() -> Callable[[Path], list[str]]:
    """All that the Khronos validator says of a .glb: errors, warnings and advice."""
    node = shutil.which("node")
    if node is None or not (HERE / "node_modules" / "gltf-validator").is_dir():
        pytest.skip("no gltf-validator: run `npm ci` in tests/io")

    def remarks(path: Path) -> list[str]:
        command = [node, HERE / "validate_gltf.cjs", path]
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        messages = json.loads(run.stdout)["issues"]["messages"]
        return [f"{item['code']} at {item.get('pointer')}: {item['message']}" for item in messages]

    return remarks


@pytest.fixture(scope="session")
def generic() -> Head:
    """The generic head itself, as if it were somebody's."""
    asset = load_generic_head()
    return Head(
        subject="nobody",
        mesh=asset.mesh,
        expressions={"neutral": Expression(asset.mesh.vertices)},
        uncertainty_mm=np.ones(len(asset.mesh.vertices)),
        unit_names=asset.unit_names,
        unit_offsets=asset.unit_offsets,
        textures={"atlas": _checker(0)},
    )


@pytest.fixture
def small_head() -> Head:
    """A skin globe of 100 mm and an eye of 24 mm before it, each unrolled with a seam at the back.

    jawOpen moves some of the skin, eyeLookUpLeft the eye alone, tongueOut nothing.
    """
    skin, eye = _globe(100.0, (0, 0, 0)), _globe(12.0, (30, 20, 100))
    vertices = np.concatenate([skin[0], eye[0]]).astype(np.float32).astype(float)
    uvs = np.concatenate([skin[2] * [0.5, 1], eye[2] * [0.5, 1] + [0.5, 0]])
    mesh = Mesh(
        vertices=vertices,
        triangles=np.concatenate([skin[1], eye[1] + len(skin[0])]),
        uvs=uvs.astype(np.float32),
        uv_triangles=np.concatenate([skin[3], eye[3] + len(skin[2])]),
        part=np.repeat([0, 1], [len(skin[1]), len(eye[1])]),
        part_names=("skin", "left_eyeball", "hair"),
    )
    offsets = np.zeros((3, *vertices.shape))
    offsets[1, np.flatnonzero(skin[0][:, 1] < -40), 1] = -10
    offsets[0, len(skin[0]) :, 1] = 2
    smile = (1.0625 * vertices).astype(np.float32)
    return Head(
        subject="Zoë",
        mesh=mesh,
        verdict=Verdict("fair", ("one photo", "and a “doubt”")),
        expressions={
            "neutral": Expression(vertices, views=(_view("front.png"), _view("side.jpg"))),
            "joy": Expression(smile, views=(_view("joy/front.heic"),), texture="joy"),
        },
        uncertainty_mm=np.linspace(0.25, 2, len(vertices)).astype(np.float32),
        unit_names=("eyeLookUpLeft", "jawOpen", "tongueOut"),
        unit_offsets=offsets.astype(np.float32),
        textures={name: _checker(seed) for seed, name in enumerate(("atlas", "cylinder", "joy"))},
        left_out={"blurred.jpg": "no face was found"},
    )


@pytest.fixture
def nod() -> HeadAnimation:
    """The mouth opens while the head turns right round about a slanted axis and moves off."""
    times = np.array([0.0, 0.25, 0.5, 1.25, 2.0])
    turn = times[:, None] / 2 * 2 * np.pi * np.array([0.6, 0.8, 0.0])
    return HeadAnimation(
        times=times,
        target_names=("joy", "jawOpen"),
        weights=np.column_stack([times / 4, [0.0, 0.5, 1.0, -0.25, 1.25]]),
        rotations=rotation_from_vector(turn),
        translations_mm=times[:, None] * [10.0, -20.0, 5.0],
        name="nod",
    )


def _globe(radius: float, center: tuple[float, float, float]) -> tuple[np.ndarray, ...]:
    """Vertices, triangles, uvs and uv triangles; the first and last column of uvs meet in space."""
    columns, rows = np.meshgrid(np.arange(COLUMNS + 1), np.arange(1, ROWS))
    uvs = np.column_stack([columns.ravel() / COLUMNS, 1 - rows.ravel() / ROWS])
    azimuth = np.pi * (2 * columns - COLUMNS) / COLUMNS
    polar = np.pi * rows / ROWS
    x, y, z = np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)
    vertices = radius * np.stack([x, y, z], -1)[:, :-1].reshape(-1, 3) + center
    row, column = (grid.ravel() for grid in np.mgrid[0 : ROWS - 2, 0:COLUMNS])
    corners = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
    on_uvs = [(row + r) * (COLUMNS + 1) + column + c for r, c in corners]
    on_vertices = [(row + r) * COLUMNS + (column + c) % COLUMNS for r, c in corners]
    triangles, uv_triangles = (
        np.stack(indices, -1).reshape(-1, 3) for indices in (on_vertices, on_uvs)
    )
    return vertices, triangles, uvs, uv_triangles


def _view(photo: str) -> FittedView:
    turn = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1, 0], [-np.sin(0.3), 0, np.cos(0.3)]])
    camera = Camera(
        width=640,
        height=800,
        focal_px=1234.5678901234567,
        R_cam_head=np.diag([1.0, -1.0, -1.0]) @ turn,
        t_cam_head=np.array([1 / 3, -20.0, 800.0]),
        principal_px=np.array([321.5, 402.25]),
    )
    return FittedView(photo, camera, 0.75, 13, {"chin": "12.1 px from where it should be"})


def _checker(seed: int) -> np.ndarray:
    squares = np.add.outer(np.arange(32) // 4, np.arange(64) // 4) % 2
    colors = np.random.default_rng(seed).integers(0, 256, (2, 3), dtype=np.uint8)
    return colors[squares]
