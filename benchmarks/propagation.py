"""All feature points from a few, as [Zhang 2006] prints it beside a closed form (Fig. 12).

Run: python -m benchmarks.propagation
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.propagation_clips import KNOWN, HeldOut, held_out, known_points
from benchmarks.table import markdown_table, write_results
from benchmarks.track_clips import CLIPS
from mien.arrays import Array, Float
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.capture.faces.detector import LandmarkDetector
from mien.synthesis.inference.conditional import ConditionalGaussian
from mien.synthesis.inference.displacement_model import DisplacementModel
from mien.synthesis.inference.propagation import COMPONENTS, MotionPropagation

NAMES = ("d10", "d6")
GIVEN = 17
"""Points, as in Fig. 12."""
STEPS = (1, 2, 3, 5, 7, 10, 15, 20, 30, 40, 50)
TARGET_PX = 1.5
FINER = (60, 40, 30)
"""Components, with a prior."""
IMAGE = Path(__file__).parents[1] / "docs" / "images" / "propagation.png"
_TO_THE_END = 1e-12


@dataclass(frozen=True)
class Variant:
    """MotionPropagation with its options, and which of the layout's hierarchies it uses."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    levels: int = 3
    backwards: bool = False

    def made(self, layout: FeatureLayout, clip: HeldOut, iterations: int) -> DisplacementModel:
        """Fitted to the statistics of a clip, with at most so many iterations."""
        sets = layout.sets[: self.levels]
        if self.backwards:
            sets = tuple(level[::-1] for level in sets)
        options = dict(self.options)
        options.setdefault("components", COMPONENTS[: self.levels])
        options.setdefault("threshold", _TO_THE_END)
        return MotionPropagation(
            replace(layout, sets=sets), clip.statistics, max_iterations=iterations, **options
        )


PRINTED = Variant("as printed")
WEIGHTED = Variant(
    "with known weight 3 and prior", {"components": FINER, "known_weight": 3.0, "prior_weight": 1.0}
)
TRIED = (
    *(Variant(f"{c} components in every set", {"components": c}) for c in (5, 8, 10, 15, 20, 30)),
    Variant("20, 15, 15 components: the default"),
    Variant("20, 15, 15, sets in reverse order", backwards=True),
    Variant("20, 10, 5", {"components": (20, 10, 5)}),
    Variant("20, 15: hierarchies 0 and 1", levels=2),
    Variant("20: hierarchy 0", levels=1),
    Variant("20, 15, 15, known weight 3", {"known_weight": 3.0}),
    Variant("20, 15, 15, known weight 3, prior", {"known_weight": 3.0, "prior_weight": 1.0}),
    Variant("30, 20, 15, known weight 3, prior", {**WEIGHTED.options, "components": (30, 20, 15)}),
    Variant("40, 30, 20, known weight 3, prior", {**WEIGHTED.options, "components": (40, 30, 20)}),
    replace(WEIGHTED, name="60, 40, 30, known weight 3, prior"),
    Variant("60, 40, 30, known weight 1, prior", {**WEIGHTED.options, "known_weight": 1.0}),
    Variant("60, 40, 30, known weight 10, prior", {**WEIGHTED.options, "known_weight": 10.0}),
    Variant("60, 40, 30, prior alone", {"components": FINER, "prior_weight": 1.0}),
    Variant(
        "60, known weight 3, prior: hierarchy 0",
        {**WEIGHTED.options, "components": (60,)},
        levels=1,
    ),
)


def mean_errors(
    model: DisplacementModel, layout: FeatureLayout, clip: HeldOut, count: int
) -> Float[Array, " 3"]:
    """Px over 25 expressions: at points that were not given, at those given, at all."""
    known = known_points(layout, count)
    found = np.array([model.infer(known, truth[known]).displacements for truth in clip.truth])
    errors = np.linalg.norm(found - clip.truth, axis=-1)
    rest = np.setdiff1d(np.arange(errors.shape[1]), known)
    return np.array([errors[:, rest].mean(), errors[:, known].mean(), errors.mean()])


def by_iteration(
    variant: Variant, layout: FeatureLayout, clip: HeldOut, counts: Sequence[int]
) -> dict[int, Float[Array, "s 3"]]:
    """For each number of given points the errors after each of STEPS."""
    made = [variant.made(layout, clip, step) for step in STEPS]
    return {
        count: np.array([mean_errors(model, layout, clip, count) for model in made])
        for count in counts
    }


def by_count(layout: FeatureLayout, clips: Mapping[str, HeldOut]) -> str:
    """Errors where nothing was given, from 5 to 40 points."""
    rows: list[list[object]] = []
    for name, clip in clips.items():
        unmoved = float(np.linalg.norm(clip.truth, axis=-1).mean())
        best = ConditionalGaussian(clip.statistics)
        same = ConditionalGaussian(clip.statistics, components=COMPONENTS[0])
        variants = [variant.made(layout, clip, STEPS[-1]) for variant in (PRINTED, WEIGHTED)]
        for count in KNOWN:
            errors = [
                float(mean_errors(model, layout, clip, count)[0])
                for model in (*variants, same, best)
            ]
            ratios = [errors[0] / errors[2], errors[0] / errors[3], errors[1] / errors[3]]
            rows.append([f"{name}, {count} points", unmoved, *errors, *ratios])
    closed = (f"closed form, {COMPONENTS[0]} components", "closed form, 60")
    ratios_named = ("printed / 20", "printed / 60", "prior / 60")
    header = ("", "unmoved", PRINTED.name, WEIGHTED.name, *closed, *ratios_named)
    return markdown_table(header, rows)


def fig_12(
    layout: FeatureLayout, clips: Mapping[str, HeldOut]
) -> tuple[str, dict[tuple[str, str], Float[Array, "s 3"]]]:
    """The table by iteration, and the curves in it."""
    curves = {
        (name, variant.name): by_iteration(variant, layout, clip, [GIVEN])[GIVEN]
        for name, clip in clips.items()
        for variant in (PRINTED, WEIGHTED)
    }
    rows: list[list[object]] = []
    for (name, variant), curve in curves.items():
        for part, errors in zip(("not given", "given", "all"), curve.T, strict=True):
            rows.append([f"{name}, {variant}: {part}", *(float(error) for error in errors)])
    return markdown_table(("iteration", *map(str, STEPS)), rows), curves


def what_was_tried(layout: FeatureLayout, clips: Mapping[str, HeldOut]) -> str:
    """Components, sets, their order, statistics and which points the head's motion is from."""
    rows: list[list[object]] = []
    for variant in TRIED:
        made = [variant.made(layout, clip, STEPS[-1]) for clip in clips.values()]
        rows.append([variant.name, *_both(made, layout, clips)])
    few = {name: clip.few(40) for name, clip in clips.items()}
    known = known_points(layout, GIVEN)
    aligned = {name: clip.aligned_by(known, statistics=False) for name, clip in clips.items()}
    both = {name: clip.aligned_by(known, statistics=True) for name, clip in clips.items()}
    for title, others in (
        ("statistics of the 40 most different frames", few),
        ("head motion by the 17 points", aligned),
        ("head motion by the 17 points, in the statistics too", both),
    ):
        for variant in (PRINTED, WEIGHTED):
            made = [variant.made(layout, clip, STEPS[-1]) for clip in others.values()]
            rows.append([f"{variant.name}: {title}", *_both(made, layout, others)])
        closed = [ConditionalGaussian(clip.statistics, components=30) for clip in others.values()]
        rows.append([f"closed form, 30 components: {title}", *_both(closed, layout, others)])
    for count in (8, 15, 20, 30, 40, 60, 90):
        closed = [ConditionalGaussian(clip.statistics, components=count) for clip in clips.values()]
        rows.append([f"closed form, {count} components", *_both(closed, layout, clips)])
    return markdown_table(("17 points, 50 iterations", *clips), rows)


def stop_rule(layout: FeatureLayout, clips: Mapping[str, HeldOut]) -> str:
    """Iterations and errors by threshold."""
    known, rows = known_points(layout, GIVEN), []
    for variant in (PRINTED, WEIGHTED):
        for threshold in (1e-1, 1e-2, 1e-3, 1e-4):
            stopping = replace(variant, options={**variant.options, "threshold": threshold})
            row: list[object] = [f"{variant.name}, {threshold:g} px"]
            for clip in clips.values():
                made = stopping.made(layout, clip, 500)
                found = [made.infer(known, truth[known]) for truth in clip.truth]
                row.append(float(np.mean([one.iterations for one in found])))
                row.append(float(mean_errors(made, layout, clip, GIVEN)[0]))
            rows.append(row)
    header = [f"{name}: {what}" for name in clips for what in ("iterations", "px")]
    return markdown_table(("17 points, threshold", *header), rows)


def _both(
    made: Sequence[DisplacementModel], layout: FeatureLayout, clips: Mapping[str, HeldOut]
) -> list[float]:
    return [
        float(mean_errors(model, layout, clip, GIVEN)[0])
        for model, clip in zip(made, clips.values(), strict=True)
    ]


def draw(
    curves: Mapping[tuple[str, str], Float[Array, "s 3"]], closed: Mapping[str, float]
) -> None:
    """Fig. 12, one panel a clip."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(closed), figsize=(8, 3.4), layout="constrained")
    for panel, (name, best) in zip(panels, closed.items(), strict=True):
        for variant, colour in ((PRINTED, "#7a8ca3"), (WEIGHTED, "#c2410c")):
            curve = curves[name, variant.name]
            panel.plot(STEPS, curve[:, 0], color=colour, label=f"{variant.name}: points not given")
            panel.plot(STEPS, curve[:, 1], color=colour, ls="--", label="the 17 given")
        panel.axhline(best, color="black", lw=1, label="closed form: points not given")
        panel.axhline(TARGET_PX, color="black", lw=0.8, ls=":", label="1.5 px")
        panel.set(title=name, xlabel="iterations", ylim=(0, None))
    panels[0].set_ylabel("mean error, px at 750x1000")
    panels[0].legend(frameon=False, fontsize=7)
    figure.savefig(IMAGE, dpi=150)
    plt.close(figure)


def explanation(clips: Mapping[str, HeldOut]) -> str:
    widths = " and ".join(
        f"{np.ptp(clip.neutral[:, 0]):.0f} px ({name}, {len(clip.statistics)} frames learned from)"
        for name, clip in clips.items()
    )
    return (
        "Statistics from odd blocks of 15 frames, the 25 most different expressions of even ones "
        "held out; head motion compensated by all points unless said otherwise. Mean errors in px "
        "of an image 1000 px high, the clip's full height, 750 wide; the face is as wide as "
        f"{widths}. Points as the detector sees them, so that its trembling is part of every error."
    )


def main() -> int:
    missing = [CLIPS[name] for name in NAMES if not CLIPS[name].is_file()]
    if missing:
        print(f"error: {missing[0]}: expected the clip, found nothing", file=sys.stderr)
        return 2
    layout = load_feature_layout()
    with LandmarkDetector() as detector:
        clips = {name: held_out(CLIPS[name], layout, detector) for name in NAMES}
    iterations, curves = fig_12(layout, clips)
    closed = {
        name: float(mean_errors(ConditionalGaussian(clip.statistics), layout, clip, GIVEN)[0])
        for name, clip in clips.items()
    }
    draw(curves, closed)
    parts = [explanation(clips)]
    parts += ["## From 5 to 40 points", "Points that were not given.", by_count(layout, clips)]
    parts += ["## By iteration, from 17 points", iterations]
    parts += ["## The stop rule", "Points that were not given.", stop_rule(layout, clips)]
    parts += ["## What was tried", "Points that were not given.", what_was_tried(layout, clips)]
    title = "All feature points from a few ([Zhang 2006] sec. 10, Fig. 12)"
    write_results("propagation", title, parts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
