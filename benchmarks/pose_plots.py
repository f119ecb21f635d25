"""Pictures for docs/notes/cameras.md. Run: python -m benchmarks.pose_plots"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.pose_errors import adjust, recover
from benchmarks.scenes import FeatureHead, generic_features, long_lens_pair, random_scene
from mien.numeric.rotation import angle_between
from mien.reconstruction.pose.recovery import recover_pose

IMAGES = Path(__file__).parents[1] / "docs" / "images"
PLAIN, FAST = "#7a8ca3", "#c2410c"


def convergence_plot(head: FeatureHead, scenes: int = 12) -> None:
    """RMS over the optimum's against sweeps, plain and accelerated."""
    import matplotlib.pyplot as plt

    counts = np.unique(np.geomspace(1, 150, 24).round().astype(int))
    figure, axes = plt.subplots(figsize=(6.4, 3.6), constrained_layout=True)
    for history, colour, name in ((0, PLAIN, "[Pighin 2002]'s sweeps"), (10, FAST, "accelerated")):
        for seed in range(scenes):
            scene = random_scene(np.random.default_rng(seed), head)
            costs = [
                recover_pose(
                    scene.image_points,
                    head.points,
                    scene.sizes,
                    loss="linear",
                    history=history,
                    max_sweeps=int(count),
                    tolerance=0.0,
                ).cost
                for count in counts
            ]
            best = np.nansum(adjust(scene, recover(scene, head)).residuals ** 2)
            label = name if seed == 0 else None
            axes.loglog(counts, np.sqrt(costs / best) - 1, color=colour, lw=1, label=label)
    axes.axhline(0.05, color="black", lw=0.8, ls=":")
    axes.text(150, 0.055, "1.05 times the optimum", fontsize=8, va="bottom", ha="right")
    axes.set(xlabel="sweeps of five steps", ylabel="RMS error over the optimum's, less 1")
    axes.set_ylim(1e-5, 10)
    axes.legend(frameon=False)
    figure.savefig(IMAGES / "pose-convergence.png", dpi=150)


def long_lens_plot(head: FeatureHead, scenes: int = 60) -> None:
    """By how much the angle between two long-lens views is missed."""
    import matplotlib.pyplot as plt

    missed: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(scenes):
        scene = long_lens_pair(np.random.default_rng(seed), head)
        start = recover(scene, head)
        true = angle_between(*(camera.R_cam_head for camera in scene.cameras))
        for marginal, found in missed.items():
            result = adjust(scene, start, sigma_px=1.5, shape_prior=head.prior(), marginal=marginal)
            turned = angle_between(*(camera.R_cam_head for camera in result.cameras))
            found.append(float(np.rad2deg(turned - true)))
    figure, axes = plt.subplots(figsize=(6.4, 3.0), constrained_layout=True)
    bins = np.arange(-6, 10.5, 0.5).tolist()
    axes.hist(missed[False], bins, color=PLAIN, label="most probable points")
    axes.hist(missed[True], bins, color=FAST, alpha=0.75, label="points integrated over")
    axes.axvline(0, color="black", lw=0.8)
    axes.set(xlabel="error of the angle between the two views, degrees", ylabel="scenes")
    axes.legend(frameon=False)
    figure.savefig(IMAGES / "pose-long-lenses.png", dpi=150)


if __name__ == "__main__":
    IMAGES.mkdir(parents=True, exist_ok=True)
    features = generic_features()
    convergence_plot(features)
    long_lens_plot(features)
