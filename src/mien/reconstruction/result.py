"""What a fit to photos gives: a shape, and for every photo its camera and residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.head import Verdict


@dataclass(frozen=True)
class Mark:
    """A feature observed in one photo.

    Attributes:
        name: of the feature.
        image_point: (2,) px.
        residual_px: (2,) projection of the fitted head's feature less image_point.
        by_hand: whether a person made it.
        rejection: why it is an outlier; "" for an inlier.
    """

    name: str
    image_point: Float[Array, " 2"]
    residual_px: Float[Array, " 2"]
    by_hand: bool
    rejection: str = ""

    @property
    def distance_px(self) -> float:
        """Length of the residual."""
        return float(np.hypot(*self.residual_px))


@dataclass(frozen=True)
class PhotoFit:
    """The camera of one photo, and the residuals of its observations.

    Attributes:
        camera: of the photo.
        marks: hand-made marks and landmarks.
        matches: surface points that other photos show, too; they outweigh landmarks.
        matches_rms_px: root mean square of their residuals.
    """

    camera: Camera
    marks: tuple[Mark, ...]
    matches: int = 0
    matches_rms_px: float = 0.0

    @property
    def inliers(self) -> tuple[Mark, ...]:
        """The marks that are no outliers."""
        return tuple(mark for mark in self.marks if not mark.rejection)

    @property
    def points_used(self) -> int:
        """How many points the camera and the shape rest on."""
        return self.matches + len(self._leading)

    @property
    def _leading(self) -> tuple[Mark, ...]:
        """Inliers that count beside the matches: where there are any, those made by hand."""
        return tuple(mark for mark in self.inliers if mark.by_hand or not self.matches)

    @property
    def rms_px(self) -> float:
        """Root mean square distance over the points used."""
        total = self.matches * self.matches_rms_px**2
        total += sum(mark.distance_px**2 for mark in self._leading)
        return float(np.sqrt(total / self.points_used)) if self.points_used else 0.0


@dataclass(frozen=True)
class Fit:
    """A shape fitted to the photos of one expression.

    Attributes:
        vertices: (V, 3) mm, head space.
        photos: by photo name, those that fit.
        left_out: by photo name, why the others were left out.
        notes: what a user should know about this fit.
    """

    vertices: Float[Array, "v 3"]
    photos: dict[str, PhotoFit]
    left_out: dict[str, str]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class NeutralFit(Fit):
    """The head at rest.

    Attributes:
        uncertainty_mm: (V,) standard deviation of each vertex, all axes together.
        verdict: how far it is to be believed.
        registered: whether its photos were registered by all the skin that they share.
        turned_over: photos that were mirrored, the right way round, as their cameras see them.
    """

    uncertainty_mm: Float[Array, " v"]
    verdict: Verdict
    registered: bool
    turned_over: tuple[CapturedView, ...] = ()

    @property
    def is_plausible(self) -> bool:
        """Whether it is a head, and its photos, where there are several, agree on it."""
        return self.verdict.grade != "poor" and (self.registered or len(self.photos) == 1)


@dataclass(frozen=True, kw_only=True)
class ExpressionFit(Fit):
    """An expression in the neutral head's frame, its eyeballs as in neutral.

    Attributes:
        units: (52,) weights of the face units that explain it.
        gaze: (2, 2) rad, yaw and pitch of the left and the right eye beyond where they look in
            neutral.
    """

    units: Float[Array, " 52"]
    gaze: Float[Array, "2 2"]
