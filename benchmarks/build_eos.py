"""One measured build by eos-py, with mien's landmarks. Run: python -m benchmarks.build_eos FOLDER

eos (github.com/patrikhuber/eos) fits a morphable model to the landmarks of one photo at a time and
takes the photo's texture. Its wheel holds no model, so it gets mien's generic head and identity
basis, and, so that it sees exactly the same places, mien's landmarks as vertices of the model.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.stages import Stages, peak_mb, report

MODEL, LANDMARKS, RESULT = "model.bin", "landmarks.npz", "eos.npz"
TEXTURE = 2048


def is_installed() -> bool:
    """Whether eos-py can be imported."""
    from importlib.util import find_spec

    return find_spec("eos") is not None


def save_model(path: Path) -> None:
    """mien's generic head and identity basis as eos keeps a model; the landmarks come last.

    The basis is made orthonormal, with the eigenvalues of the same distribution.
    """
    import eos

    from mien.assets.generic import load_generic_head

    generic = load_generic_head()
    corners = generic.mesh.triangles[generic.landmark_triangles]
    weights = generic.landmark_barycentrics

    def with_landmarks(values: Any) -> Any:
        places = np.einsum("nc,...ncd->...nd", weights, values[..., corners, :])
        return np.concatenate([values, places], axis=-2)

    mean = with_landmarks(generic.mesh.vertices)
    components = with_landmarks(generic.identity.components.astype(np.float64))
    basis, singular, _ = np.linalg.svd(
        components.reshape(len(components), -1).T, full_matrices=False
    )
    shape = eos.morphablemodel.PcaModel(
        mean.reshape(-1, 1).astype(np.float32),
        basis.astype(np.float32),
        (singular[:, None] ** 2).astype(np.float32),
        generic.mesh.triangles.tolist(),
    )
    # Without an expression model fit_shape_and_pose fails, so it gets one that moves nothing.
    still = eos.morphablemodel.Blendshape()
    still.name, still.deformation = "none", np.zeros(mean.size, np.float32)
    model = eos.morphablemodel.MorphableModel(
        shape,
        [still],
        eos.morphablemodel.PcaModel(),
        None,
        (generic.mesh.uvs * [1, -1] + [0, 1]).tolist(),
        generic.mesh.uv_triangles.tolist(),
    )
    eos.morphablemodel.save_model(model, str(path))


def main(folder: Path) -> None:
    """Photos and landmarks to one textured `.obj`: a fit a photo, and the mean of them all."""
    import eos
    from PIL import Image

    stages = Stages()
    given = np.load(folder / LANDMARKS)
    model = eos.morphablemodel.load_model(str(folder / MODEL))
    photos = [np.asarray(Image.open(path).convert("RGBA")) for path in given["photos"]]
    stages.lap("load")
    count = len(np.asarray(model.get_mean().vertices))
    fits = [
        _fit(model, photo, points, used, count)
        for photo, points, used in zip(photos, given["points"], given["used"], strict=True)
    ]
    stages.lap("fit")
    textures = [
        eos.render.extract_texture(mesh, camera, photo, TEXTURE)
        for (mesh, camera, _), photo in zip(fits, photos, strict=True)
    ]
    stages.lap("texture")
    mean = model.draw_sample(list(np.mean([fit[2] for fit in fits], axis=0)), [0.0], [])
    texture = _mean_texture(textures)
    stages.lap("combine")
    eos.core.write_textured_obj(mean, str(folder / "eos.obj"))
    Image.fromarray(texture).save(folder / "eos.texture.png", compress_level=1)
    stages.lap("write")
    peak = peak_mb()
    _save_result(fits, mean, photos, given, folder / RESULT)
    report(stages, peak)


def _fit(model: Any, photo: Any, points: Any, used: Any, count: int) -> tuple[Any, Any, Any]:
    """Mesh, camera and shape coefficients of one photo, with eos's defaults."""
    import eos

    first = count - len(points)
    landmarks = [
        eos.core.Landmark(str(first + number), points[number].astype(np.float32))
        for number in np.flatnonzero(used)
    ]
    height, width = photo.shape[:2]
    mesh, camera, shape, _ = eos.fitting.fit_shape_and_pose(
        model, landmarks, eos.core.LandmarkMapper(), width, height
    )
    return mesh, camera, shape


def _mean_texture(textures: list[Any]) -> Any:
    """Of every texel the mean over the photos that show it."""
    total = np.zeros((TEXTURE, TEXTURE, 3), np.float32)
    shown = np.zeros((TEXTURE, TEXTURE, 1), np.float32)
    for texture in textures:
        seen = texture[..., 3:] > 0
        total += texture[..., :3] * seen
        shown += seen
    return (total / np.maximum(shown, 1)).round().astype(np.uint8)


def _save_result(fits: list[Any], mean: Any, photos: list[Any], given: Any, path: Path) -> None:
    """(V, 3) of the mean head; (K, 478, 2) px of each photo's own head and of the mean head."""
    import eos

    vertices, own, shared = np.asarray(mean.vertices), [], []
    landmarks = given["points"].shape[1]
    for (mesh, camera, _), photo, points, used in zip(
        fits, photos, given["points"], given["used"], strict=True
    ):
        height, width = photo.shape[:2]
        own.append(_project(np.asarray(mesh.vertices)[-landmarks:], camera, width, height))
        # The mean head gets the camera that suits it best, found as eos finds cameras.
        places = vertices[-landmarks:]
        homogeneous = np.column_stack([places, np.ones(landmarks)]).astype(np.float32)
        refitted = eos.fitting.estimate_orthographic_projection_linear(
            list(points[used].astype(np.float32)), list(homogeneous[used]), True, height
        )
        camera = eos.fitting.RenderingParameters(refitted, width, height)
        shared.append(_project(places, camera, width, height))
    np.savez(path, vertices=vertices[:-landmarks], projected=own, projected_mean=shared)


def _project(points: Any, camera: Any, width: int, height: int) -> Any:
    import eos

    affine = eos.fitting.get_3x4_affine_camera_matrix(camera, width, height)
    return points @ affine[:2, :3].T + affine[:2, 3]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
