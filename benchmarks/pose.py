"""How well cameras are recovered from 13 + 99 feature points. Run: python -m benchmarks.pose"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.bound import within_shares
from benchmarks.pose_errors import Errors, adjust, angle_error, focal_prior, measure, recover
from benchmarks.scenes import FeatureHead, Scene, generic_features, long_lens_pair, random_scene
from benchmarks.table import markdown_table, write_results
from mien.arrays import Array, Float
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.adjustment import Adjustment, FocalPrior, adjust_bundle
from mien.reconstruction.pose.recovery import PoseResult, recover_pose

DEGREES, RELATIVE = 0.3, 0.05
"""What counts as recovered: rotation and focal length."""

Family = Callable[[np.random.Generator, FeatureHead], Scene]
FAMILIES: dict[str, Family] = {
    "every point marked in every photo, 0.6 to 1 m": partial(
        random_scene, distance_mm=(600, 1000), hidden=False
    ),
    "every point marked in every photo, 0.6 to 2 m": partial(random_scene, hidden=False),
    "points hidden where they turn away, 0.6 to 1 m": partial(
        random_scene, distance_mm=(600, 1000)
    ),
    "points hidden where they turn away, 0.6 to 2 m": random_scene,
}


def accuracy(head: FeatureHead, scenes: int = 100) -> list[str]:
    """Tables of errors by family of scenes and by what is known."""
    parts = []
    for title, family in FAMILIES.items():
        errors: dict[str, list[Errors]] = {}
        bounds = []
        for seed in range(scenes):
            rng = np.random.default_rng(seed)
            scene = family(rng, head)
            start = recover(scene, head)
            known = focal_prior(scene, rng, 0.05)
            answers: dict[str, PoseResult | Adjustment] = {
                "five steps": start,
                "bundle adjustment": adjust(scene, start),
                "with identity prior": adjust(scene, start, shape_prior=head.prior()),
                "with identity prior and focal lengths known to 5 %": adjust(
                    scene, start, shape_prior=head.prior(), focal_prior=known
                ),
            }
            for name, answer in answers.items():
                errors.setdefault(name, []).append(measure(answer.cameras, answer.points, scene))
            bounds.append(within_shares(scene, rng, np.deg2rad(DEGREES), RELATIVE))
        rows = [_accuracy_row(name, found) for name, found in errors.items()]
        bound = [100 * float(share) for share in np.mean(bounds, axis=0)]
        rows.append(["bound without priors", *bound, *["-"] * 5])
        parts += [f"**{title[0].upper()}{title[1:]}** ({scenes} scenes of five cameras)"]
        parts += [markdown_table(_ACCURACY_HEADER, rows)]
    return parts


_ACCURACY_HEADER = [
    "",
    "cameras within 0.3 deg, %",
    "cameras within 5 % focal, %",
    "scenes with all five within both, %",
    "median deg",
    "95th pct deg",
    "median focal, %",
    "95th pct focal, %",
    "surface, median mm",
]


def _accuracy_row(name: str, errors: list[Errors]) -> list[object]:
    degrees = np.stack([error.degrees for error in errors])
    focal = np.stack([error.focal for error in errors])
    turned, zoomed = degrees <= DEGREES, focal <= RELATIVE
    return [
        name,
        100 * float(turned.mean()),
        100 * float(zoomed.mean()),
        100 * float((turned & zoomed).all(axis=1).mean()),
        float(np.median(degrees)),
        float(np.percentile(degrees, 95)),
        100 * float(np.median(focal)),
        100 * float(np.percentile(focal, 95)),
        float(np.median([error.surface_mm for error in errors])),
    ]


def optimality(head: FeatureHead, scenes: int = 100, plain_scenes: int = 10) -> str:
    """How near the five steps come to the bundle-adjusted optimum, and what that takes."""
    rows = []
    for name, history, count in (
        ("five steps, accelerated", 10, scenes),
        ("five steps, plain", 0, plain_scenes),
    ):
        ratios, sweeps, seconds = [], [], []
        for seed in range(count):
            scene = random_scene(np.random.default_rng(seed), head)
            begun = time.perf_counter()
            start = recover_pose(
                scene.image_points,
                head.points,
                scene.sizes,
                loss="linear",
                history=history,
                max_sweeps=2000,
            )
            seconds.append(time.perf_counter() - begun)
            best = adjust(scene, start)
            ratios.append(np.sqrt(start.cost / np.nansum(best.residuals**2)))
            sweeps.append(start.sweeps)
        rows.append(
            [
                name,
                count,
                f"{np.median(ratios):.5f}",
                f"{np.max(ratios):.5f}",
                float(np.median(sweeps)),
                float(np.max(sweeps)),
                float(np.median(seconds)),
            ]
        )
    header = ["", "scenes", "RMS over optimum's, median", "largest", "sweeps, median", "largest"]
    return markdown_table([*header, "seconds"], rows)


def convergence(head: FeatureHead, starts: int = 200) -> str:
    """Share of rough starts from which the five steps reach the optimum."""
    rows = []
    for loss in ("linear", "cauchy"):
        ratios = np.array([_from_rough_start(head, seed, loss) for seed in range(starts)])
        share = 100 * float((ratios <= 1.05).mean())
        rows.append([loss, starts, share, f"{np.median(ratios):.5f}", f"{ratios.max():.5f}"])
    return markdown_table(
        ["loss", "starts", "within 1.05 of the optimum, %", "RMS over optimum's", "largest"], rows
    )


def _from_rough_start(head: FeatureHead, seed: int, loss: str) -> float:
    """RMS over the optimum's, started 20 degrees and a factor of 2 off; infinite if refused."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, head)
    axes = rng.normal(size=(len(scene.cameras), 3))
    turns = np.deg2rad(20) * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    true = np.stack([camera.R_cam_head for camera in scene.cameras])
    factors = 2.0 ** rng.choice([-1, 1], size=len(true))
    result = recover_pose(
        scene.image_points,
        head.points,
        scene.sizes,
        rotations=rotation_from_vector(turns) @ true,
        focal_px=factors * np.array([camera.focal_px for camera in scene.cameras]),
        loss=loss,
    )
    if any(result.problems):
        return np.inf
    best = adjust_bundle(scene.cameras, scene.points, scene.image_points)
    return float(np.sqrt(result.cost / np.nansum(best.residuals**2)))


def long_lenses(head: FeatureHead, scenes: int = 50) -> str:
    """Two nearly affine views, whose angle only knowledge of faces can tell."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    for seed in range(scenes):
        rng = np.random.default_rng(seed)
        scene = long_lens_pair(rng, head)
        start = recover(scene, head)
        prior = {"sigma_px": 1.5, "shape_prior": head.prior()}
        rough = FocalPrior(np.full(2, 6400 * np.exp(0.2 * rng.normal())), np.full(2, 0.2))
        answers = {
            "generic head, not fitted": (start.cameras, head.points),
            "five steps": (start.cameras, start.points),
            "bundle adjustment": _answer(adjust(scene, start, sigma_px=1.5)),
            "with identity prior, points at their most probable places": _answer(
                adjust(scene, start, **prior, marginal=False)
            ),
            "with identity prior, points integrated over": _answer(adjust(scene, start, **prior)),
            "the same, and focal length known to 20 %": _answer(
                adjust(scene, start, **prior, focal_prior=rough)
            ),
        }
        for name, (cameras, points) in answers.items():
            error = measure(cameras, points, scene)
            turned = angle_error(cameras, scene)
            found.setdefault(name, []).append(
                (turned, 100 * float(error.focal.mean()), error.surface_mm)
            )
    header = ["", "angle between views, median deg off", "90th pct", "focal, median % off"]
    return markdown_table(
        [*header, "surface, median mm", "90th pct"],
        [_long_lens_row(name, np.array(values)) for name, values in found.items()],
    )


def _long_lens_row(name: str, values: Float[Array, "s 3"]) -> list[object]:
    degrees, focal, surface = values.T
    cameras: list[object] = [
        float(np.median(degrees)),
        float(np.percentile(degrees, 90)),
        float(np.median(focal)),
    ]
    if name.startswith("generic"):
        cameras = ["-", "-", "-"]
    return [name, *cameras, float(np.median(surface)), float(np.percentile(surface, 90))]


def _answer(result: Adjustment) -> tuple[tuple[Camera, ...], Array]:
    return result.cameras, result.points


def main() -> None:
    """Runs everything and writes results/pose.md."""
    head = generic_features()
    intro = (
        "Random people (identity basis, and 1 mm at every point of what it leaves out) before five "
        "cameras of their own focal lengths, at yaw -60 to 60 degrees, images of 1 to 2 "
        "megapixels that the head fills, 1 px noise. Errors after the best similarity. "
        "The bound (Cramer-Rao) is the share that any unbiased method can reach without priors."
    )
    write_results(
        "pose",
        "Cameras from feature points",
        [
            intro,
            "## Accuracy",
            *accuracy(head),
            "## Five steps against the optimum",
            optimality(head),
            "## Starts 20 degrees and a factor of 2 in focal length off",
            convergence(head),
            "## Two long lenses: 6,400 px, 48 degrees apart, 90 px off centre, 1.5 px noise",
            long_lenses(head),
        ],
    )


if __name__ == "__main__":
    main()
