"""Quality of a registration, and notes for the user on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead
from mien.reconstruction.bundle.projection import POSE_SIZE
from mien.reconstruction.dense.joint import JointSolution, noise_factor
from mien.reconstruction.dense.tracks import Tracks

MIN_SHARED_POINTS = 60
"""A photo that shares fewer with the others is not registered by them."""
MAX_ROTATION_SD_DEG = 2.0
_WRONG_SIGMAS = 3.0
"""An observation this many times the usual error off is an outlier."""
_OUTLIER_FRACTION, _OUTLIER_RATIO, _OUTLIER_POINTS = 0.25, 2.0, 20
"""A region of a photo differs when so much of it disagrees, so many times more than in the other
photos, judged by at least so many points."""
REGIONS = {"mouth": "the mouth", "eyes": "the eyes", "forehead": "the forehead"}


@dataclass(frozen=True)
class RegistrationQuality:
    """How well the photos agree with each other.

    Attributes:
        shared: (K,) points that each photo shares with others.
        outlier_fraction: (K, R) share of them that disagree, by region of REGIONS; NaN for too few.
        turn_sd: (K,) radians, of each photo's turn against the first.
        rms_px: (K,) of the residuals of the points that agree.
    """

    shared: Int[Array, " k"]
    outlier_fraction: Float[Array, "k r"]
    turn_sd: Float[Array, " k"]
    rms_px: Float[Array, " k"]

    def notes(self, names: Sequence[str]) -> tuple[str, ...]:
        """What a user should know, by photo."""
        lines = [
            f"{name}: shares too little skin with the other photos ({shared} places) to be "
            "registered by it; its camera rests on landmarks"
            for name, shared in zip(names, self.shared, strict=True)
            if shared < MIN_SHARED_POINTS
        ]
        for k, name in enumerate(names):
            odd = [text for r, text in enumerate(REGIONS.values()) if self._differs(k, r)]
            if odd:
                verb = "differs" if odd == ["the mouth"] or odd == ["the forehead"] else "differ"
                lines.append(
                    f"{name}: {' and '.join(odd)} {verb} from the other photos (another "
                    "expression?); these parts of it count less"
                )
        worst = float(np.degrees(self.turn_sd.max()))
        if worst > MAX_ROTATION_SD_DEG:
            lines.append(
                f"the angle between the photos is known to {worst:.0f} degrees only, and with it "
                "how deep the face is: a photo from a third side would tell"
            )
        return tuple(lines)

    def _differs(self, k: int, region: int) -> bool:
        share, others = (
            self.outlier_fraction[k, region],
            np.delete(self.outlier_fraction[:, region], k),
        )
        known = others[np.isfinite(others)]
        if not np.isfinite(share) or len(known) < 2:
            return False
        return bool(share > _OUTLIER_FRACTION and share > _OUTLIER_RATIO * np.median(known))


def assess_registration(
    tracks: Tracks, solution: JointSolution, generic: GenericHead
) -> RegistrationQuality:
    """From the last joint solution and the tracks it rests on."""
    photos = len(solution.cameras)
    # By the errors of single matches, whatever noise the solution had to allow for.
    sigma_px = tracks.sigma_px * np.sqrt(tracks.overlap)[tracks.point]
    allowed = solution.problem.observations.sigma_px[: len(tracks.photo)]
    off = solution.normalized_residuals[: len(tracks.photo)] * allowed / sigma_px
    wrong = off > _WRONG_SIGMAS * noise_factor(off)
    masks = np.stack([generic.regions[name] for name in REGIONS], axis=-1)
    inside = tracks.on(masks)[tracks.point] > 0.5
    outlier_fraction = np.full((photos, len(REGIONS)), np.nan)
    for k in range(photos):
        for r in range(len(REGIONS)):
            here = (tracks.photo == k) & inside[:, r]
            if np.count_nonzero(here) >= _OUTLIER_POINTS:
                outlier_fraction[k, r] = wrong[here].mean()
    agreeing = tracks.photo[~wrong]
    shared = np.bincount(agreeing, minlength=photos)
    squares = (off * sigma_px)[~wrong] ** 2
    mean = np.bincount(agreeing, squares, minlength=photos) / np.maximum(shared, 1)
    return RegistrationQuality(
        shared, outlier_fraction, _rotation_sds(solution, photos), np.sqrt(mean)
    )


def _rotation_sds(solution: JointSolution, photos: int) -> Float[Array, " k"]:
    covariance = solution.covariance
    rotations = [camera.R_cam_head for camera in solution.cameras]
    deviations = np.zeros(photos)
    for k in range(1, photos):
        # Each photo's unknowns turn its own camera's space.
        by_turns = np.zeros((3, len(covariance)))
        by_turns[:, :3] = -rotations[k] @ rotations[0].T
        by_turns[:, POSE_SIZE * k : POSE_SIZE * k + 3] = np.eye(3)
        deviations[k] = np.sqrt(max(float(np.trace(by_turns @ covariance @ by_turns.T)), 0.0))
    return deviations
