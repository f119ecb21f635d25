"""Filmed faces split into examples and held-out frames, and the quality of a drawn frame."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mien.arrays import Array, Bool, Float, Int, UInt8
from mien.assets.feature_points import FeatureLayout
from mien.assets.subregions import default_subregions
from mien.capture.faces.detector import LandmarkDetector
from mien.capture.faces.mediapipe_face import yaw_pitch
from mien.capture.faces.sharpness import face_sharpness
from mien.capture.video.video import Video
from mien.synthesis.examples.example_plan import TEETH_GAP, lip_gaps
from mien.synthesis.examples.example_set import Example, ExampleSet
from mien.synthesis.examples.head_alignment import align_to_neutral
from mien.synthesis.examples.landmark_averaging import averaged_points
from mien.synthesis.examples.selection import ExampleCandidates, choose_examples

__all__ = [
    "FilmedFace",
    "PictureQuality",
    "chosen_rows",
    "example_set",
    "face_mask",
    "filmed",
    "held_out",
    "picture_quality",
    "with_averaged_points",
]

BLOCK = 15
"""Frames that are not split, so that no held-out frame has its neighbour among the examples."""
_MESH_LANDMARKS = 468


@dataclass(frozen=True)
class FilmedFace:
    """The frames of a clip in which a face was found.

    Attributes:
        frames: (h, w, 3) each.
        index: (N,) their numbers in the clip.
        landmarks: (N, 478, 2) px.
        points: (N, n, 2) px of the layout.
        pose: (N, 2) yaw and pitch, radians.
        sharpness: (N,).
    """

    layout: FeatureLayout
    frames: tuple[UInt8[Array, "h w 3"], ...]
    index: Int[Array, " N"]
    landmarks: Float[Array, "N 478 2"]
    points: Float[Array, "N n 2"]
    pose: Float[Array, "N 2"]
    sharpness: Float[Array, " N"]

    @property
    def lip_gaps(self) -> Float[Array, " N"]:
        """Distance of the lips, in widths of the face."""
        return lip_gaps(self.layout, self.points) / np.ptp(self.points[..., 0], axis=1)


def filmed(clip: Path, layout: FeatureLayout, detector: LandmarkDetector) -> FilmedFace:
    """A clip as the detector sees it."""
    frames, index, faces = [], [], []
    for frame in Video(clip).frames():
        pixels = frame.pixels()
        face = detector.detect_fast(pixels)
        if face is not None:
            frames.append(pixels)
            index.append(frame.index)
            faces.append(face)
    landmarks = np.array([face.points[:, :2] for face in faces])
    sharpness = [face_sharpness(f, p) for f, p in zip(frames, landmarks, strict=True)]
    return FilmedFace(
        layout=layout,
        frames=tuple(frames),
        index=np.array(index),
        landmarks=landmarks,
        points=layout.landmark_weights @ landmarks,
        pose=np.array([yaw_pitch(face.R_cam_head) for face in faces]),
        sharpness=np.array(sharpness),
    )


def with_averaged_points(
    face: FilmedFace, rows: Collection[int], detector: LandmarkDetector
) -> FilmedFace:
    """The same with points averaged over several detections in some frames."""
    points = face.points.copy()
    for row in rows:
        frame, landmarks = face.frames[row], face.landmarks[row]
        points[row] = averaged_points(face.layout, detector, frame, landmarks)
    return replace(face, points=points)


def chosen_rows(face: FilmedFace, count: int, *, odd: bool) -> list[int]:
    """Rows of the examples from the odd blocks, or the even ones, chosen as mien chooses them."""
    rows = np.flatnonzero((face.index // BLOCK % 2 == 1) == odd)
    points = face.points[rows]
    neutral = _neutral_row(points, face.lip_gaps[rows])
    geometries, _ = align_to_neutral(points, points[neutral])
    shapes = default_subregions(face.layout, points[neutral], (1, 1))
    regions = list(zip(shapes.names, shapes.members, strict=True))
    candidates = ExampleCandidates(geometries, face.sharpness[rows], face.pose[rows])
    chosen = choose_examples(candidates, regions, neutral, count=count).rows
    return [int(row) for row in rows[chosen]]


def example_set(face: FilmedFace, rows: Sequence[int]) -> ExampleSet:
    """Frames as examples, the first one neutral, that with the widest open mouth the standard."""
    chosen, gaps = face.points[rows], face.lip_gaps[rows]
    standard = int(gaps.argmax())
    height, width = face.frames[0].shape[:2]
    geometries, _ = align_to_neutral(chosen, chosen[0])
    return ExampleSet(
        layout=face.layout,
        examples=tuple(_example(face, row) for row in rows),
        standard=standard,
        statistics=geometries,
        subregions=default_subregions(face.layout, chosen[standard], (width, height)),
        teeth=tuple(np.flatnonzero(gaps >= TEETH_GAP).tolist()),
    )


def held_out(face: FilmedFace, count: int, *, odd: bool, skip: int = 0) -> list[int]:
    """Evenly spaced rows of the blocks without examples.

    Args:
        face: the clip.
        count: of the rows.
        odd: the examples are from the odd blocks.
        skip: 0 to 1, offset in units of the spacing.
    """
    rows = np.flatnonzero((face.index // BLOCK % 2 == 1) != odd)
    positions = (np.arange(count) + 0.5 * skip) * len(rows) / count
    return [int(row) for row in rows[np.unique(positions.astype(int))]]


def face_mask(face: FilmedFace, row: int) -> Bool[Array, "h w"]:
    """Pixels within the convex hull of a frame's landmarks."""
    import cv2

    mask = np.zeros(face.frames[row].shape[:2], np.uint8)
    hull = cv2.convexHull(face.landmarks[row, :_MESH_LANDMARKS].astype(np.float32))
    filled = cv2.fillConvexPoly(mask, hull.astype(np.int32), 1)
    return np.asarray(filled) > 0


@dataclass(frozen=True)
class PictureQuality:
    """Similarity of a picture to the true one, over a mask.

    Attributes:
        psnr: dB.
        ssim: of brightness, windows of 11 px.
        detail: standard deviation of what is finer than 2 px, relative to the true picture's: 1
            is as sharp, less is blurred.
    """

    psnr: float
    ssim: float
    detail: float


def picture_quality(
    picture: UInt8[Array, "h w 3"], truth: UInt8[Array, "h w 3"], mask: Bool[Array, "h w"]
) -> PictureQuality:
    """PSNR, SSIM (Wang et al. 2004) and the amount of fine detail."""
    squared = (picture[mask].astype(float) - truth[mask]) ** 2
    pair = [_grey(image) for image in (picture, truth)]
    means = [_blurred(image) for image in pair]
    variances = [_blurred(g * g) - m * m for g, m in zip(pair, means, strict=True)]
    shared = _blurred(pair[0] * pair[1]) - means[0] * means[1]
    bright, contrast = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    numerator = (2 * means[0] * means[1] + bright) * (2 * shared + contrast)
    denominator = (means[0] ** 2 + means[1] ** 2 + bright) * (sum(variances) + contrast)
    fine = [float((image - mean)[mask].std()) for image, mean in zip(pair, means, strict=True)]
    return PictureQuality(
        psnr=float(10 * np.log10(255**2 / max(squared.mean(), 1e-9))),
        ssim=float((numerator / denominator)[mask].mean()),
        detail=fine[0] / fine[1],
    )


def _grey(image: UInt8[Array, "h w 3"]) -> Float[Array, "h w"]:
    import cv2

    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), float)


def _blurred(image: Float[Array, "h w"]) -> Float[Array, "h w"]:
    import cv2

    return np.asarray(cv2.GaussianBlur(image, (11, 11), 1.5))


def _neutral_row(points: Float[Array, "N n 2"], gaps: Float[Array, " N"]) -> int:
    """The frame that is nearest to the median one and whose mouth is not open."""
    geometries, _ = align_to_neutral(points, points[0])
    width = float(np.ptp(np.median(geometries, axis=0)[:, 0]))
    distances = np.linalg.norm(geometries - np.median(geometries, axis=0), axis=(1, 2)) / width
    return int((distances + 3 * gaps).argmin())


def _example(face: FilmedFace, row: int) -> Example:
    number = int(face.index[row])
    return Example(f"{number:06d}", face.frames[row], face.points[row], f"frame {number}")
