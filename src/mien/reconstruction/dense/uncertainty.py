"""How far each vertex may lie from the truth, given all that the photos tell."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.reconstruction.dense.prior import ASYMMETRIC_SD_MM, SYMMETRIC_SD_MM, HeadPrior
from mien.reconstruction.dense.surface import Offsets, sample_heights
from mien.reconstruction.dense.tracks import Tracks

ACROSS_SD_MM = 1.0
"""Deviations from the smooth prior across the surface where no photo tells."""
ALONG_SD_MM = 1.0
"""How far a point lies along the surface from its correspondence: on plain skin nothing fixes which
point of another face corresponds."""
_DRAWS = 48


def vertex_deviation(
    covariance: Float[Array, "c c"],
    prior: HeadPrior,
    tracks: Tracks,
    offsets: Offsets,
    generic: GenericHead,
) -> Float[Array, " v"]:
    """(V,) mm: standard deviation of each vertex, all three axes together.

    It adds up what stays open of the shape's coefficients, what the surface's offsets leave open
    across the surface, what the smooth modes cannot express, and sliding along the surface. It
    holds for the shape: where the head lies and how large it is, photos do not tell.

    Args:
        covariance: (C, C) of the prior's coefficients.
        prior: of the shape.
        tracks: of the last matching.
        offsets: of the tracks from the surface.
        generic: the generic head.
    """
    of_coefficients = _spread(covariance, prior.components)
    heights = sample_heights(tracks, offsets, generic, draws=_DRAWS)
    across = 1 / (1 / np.maximum(heights.var(axis=0), 1e-6) + 1 / ACROSS_SD_MM**2)
    # Where the surface is measured, so is what the modes leave out.
    unmeasured = across / ACROSS_SD_MM**2
    variance = of_coefficients + across + unmeasured * _left_out(prior) + ALONG_SD_MM**2
    return np.sqrt(variance)


def _spread(covariance: Float[Array, "c c"], components: Float[Array, "c v 3"]) -> Array:
    """(V,) variance, summed over the axes."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0))
    fields = np.tensordot(root.T, components, 1)
    return (fields**2).sum(axis=(0, 2))


def _left_out(prior: HeadPrior) -> Float[Array, " v"]:
    """(V,) variance of smooth deviations that the modes kept do not express."""
    smooth = prior.components[prior.identity_count :]
    expressed = (smooth**2).sum(axis=(0, 2))
    whole = 3 * (SYMMETRIC_SD_MM**2 + ASYMMETRIC_SD_MM**2)
    return np.maximum(whole - expressed, 0)
