"""How far a registration can be trusted, and what to tell the user of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.generic import GenericHead
from mien.reconstruction.bundle.projection import POSE_SIZE
from mien.reconstruction.dense.joint import JointSolution, noise_factor
from mien.reconstruction.dense.surface_tracks import Tracks

FEW_PLACES = 60
"""A photo that shares fewer with the others is not registered by them."""
UNSURE_TURN_DEG = 2.0
_WRONG_SIGMAS = 3.0
"""An observation this many times the usual error off disagrees with the other photos."""
_ODD_SHARE, _ODD_RATIO, _ODD_PLACES = 0.25, 2.0, 20
"""A region of a photo differs when so much of it disagrees, so many times more than in the other
photos, judged by at least so many places."""
REGIONS = {"mouth": "the mouth", "eyes": "the eyes", "forehead": "the forehead"}


@dataclass(frozen=True)
class Quality:
    """What the photos say of each other.

    Attributes:
        shared: (K,) places that each photo shares with others.
        disagreeing: (K, R) share of them that disagree, by region of REGIONS; NaN for too few.
        turn_sd: (K,) radians, of each photo's turn against the first.
        rms_px: (K,) of the residuals of the places that agree.
    """

    shared: Int[Array, " k"]
    disagreeing: Float[Array, "k r"]
    turn_sd: Float[Array, " k"]
    rms_px: Float[Array, " k"]

    def notes(self, names: Sequence[str]) -> tuple[str, ...]:
        """What a user should know, by photo."""
        lines = [
            f"{name}: shares too little skin with the other photos ({shared} places) to be "
            "registered by it; its camera rests on landmarks"
            for name, shared in zip(names, self.shared, strict=True)
            if shared < FEW_PLACES
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
        if worst > UNSURE_TURN_DEG:
            lines.append(
                f"the angle between the photos is known to {worst:.0f} degrees only, and with it "
                "how deep the face is: a photo from a third side would tell"
            )
        return tuple(lines)

    def _differs(self, k: int, region: int) -> bool:
        share, others = self.disagreeing[k, region], np.delete(self.disagreeing[:, region], k)
        known = others[np.isfinite(others)]
        if not np.isfinite(share) or len(known) < 2:
            return False
        return bool(share > _ODD_SHARE and share > _ODD_RATIO * np.median(known))


def judge_registration(tracks: Tracks, solution: JointSolution, generic: GenericHead) -> Quality:
    """From the last joint solution and the tracks it rests on."""
    photos = len(solution.cameras)
    off = solution.normalized_residuals[: len(tracks.photo)]
    wrong = off > _WRONG_SIGMAS * noise_factor(off)
    masks = np.stack([generic.regions[name] for name in REGIONS], axis=-1)
    inside = tracks.on(masks)[tracks.place] > 0.5
    disagreeing = np.full((photos, len(REGIONS)), np.nan)
    for k in range(photos):
        for r in range(len(REGIONS)):
            here = (tracks.photo == k) & inside[:, r]
            if np.count_nonzero(here) >= _ODD_PLACES:
                disagreeing[k, r] = wrong[here].mean()
    agreeing = tracks.photo[~wrong]
    shared = np.bincount(agreeing, minlength=photos)
    sigma_px = tracks.sigma_px * np.sqrt(tracks.crowding)[tracks.place]
    squares = (off * sigma_px)[~wrong] ** 2
    mean = np.bincount(agreeing, squares, minlength=photos) / np.maximum(shared, 1)
    return Quality(shared, disagreeing, _turn_deviations(solution, photos), np.sqrt(mean))


def _turn_deviations(solution: JointSolution, photos: int) -> Float[Array, " k"]:
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
