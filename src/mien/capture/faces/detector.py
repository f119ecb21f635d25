"""Detection of the face in a photo: small, turned on its side, or one of several."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mien.arrays import Array, UInt8
from mien.assets.networks import detector_model_path
from mien.capture.faces.landmarks import Landmarks, cut_note, facing_confidence, inside_picture
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS, DetectedFace, FaceNetwork
from mien.capture.images.photos import Photo, downscale
from mien.errors import EstimationError, InputError

MIN_EYE_DISTANCE_PX = 20.0
"""Below this landmarks are off by more than 3.5 % of the distance between the eyes."""

GOOD_EYE_DISTANCE_PX = 60.0
"""From here on they are good to 1 % of it; more pixels add little."""

SMALL_FACE = 0.15
"""A face narrower than this part of a frame's longer side is detected again in a crop."""

NO_FACE_FOUND = (
    "no face found; one must look within about 50 degrees of the camera and fill a twentieth of "
    "the photo's width"
)

_SEARCH_SIDE = 1280
_CROP_WIDTHS = 1.5
_CROP_SIDE = 768
_MAX_SHIFT = 0.02
_QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


class NoFaceError(EstimationError):
    """A photo in which no face is found: there is none, or it is turned too far away."""


class LandmarkDetector:
    """Finds a face and its landmarks. Use as a context manager, or call `close`.

    Raises:
        MienError: a shared library of the system is missing; names it.
    """

    def __init__(self) -> None:
        self._network = FaceNetwork(detector_model_path())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the network."""
        self._network.close()

    def detect(self, photo: Photo, *, face: int | None = None) -> Landmarks:
        """The landmarks of the largest face, or of the one asked for.

        The network gets a reduced photo first and then a crop of the face at good resolution: for a
        face under a tenth of the photo's width this takes the error from 12 % to 0.5 % of the
        distance between the eyes; for larger ones it changes nothing. A large shift between the
        two passes reveals a false detection, as in photos that lie on their side.

        Args:
            photo: upright by what its file states.
            face: which one, counted from 1 from left to right in the photo.

        Raises:
            InputError: `face` is not positive, or there are fewer faces.
            NoFaceError: no face.
            EstimationError: one too small.
        """
        if face is not None and face < 1:
            raise InputError("face", "a number from 1 on", face)
        detection = self._best_detection(photo, face)
        if detection is None:
            raise NoFaceError(f"{photo.name}: {NO_FACE_FOUND}")
        return _landmarks(photo, detection)

    def detect_fast(self, pixels: UInt8[Array, "h w 3"]) -> DetectedFace | None:
        """The largest face after a single pass, upright only: for the frames of a video."""
        return next(iter(self.detect_all_fast(pixels)), None)

    def detect_all_fast(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Every face, the largest first, after a single pass, upright only."""
        return sorted(self._network.faces(pixels), key=lambda found: -found.width)

    def detect_in_tiles(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Upright faces too small to be found in the whole picture: in nine overlapping tiles."""
        height, width = pixels.shape[:2]
        faces: list[DetectedFace] = []
        if min(height, width) < 2:
            return faces
        for top in (0, height // 4, height // 2):
            for left in (0, width // 4, width // 2):
                part = pixels[top : top + height // 2, left : left + width // 2]
                small = downscale(part, _SEARCH_SIDE // 2)
                factor = part.shape[1] / small.shape[1]
                for found in self._network.faces(small):
                    moved = _shifted(found, factor, (left, top))
                    if not any(is_same_face(moved, other) for other in faces):
                        faces.append(moved)
        return faces

    def _best_detection(self, photo: Photo, face: int | None) -> _Detection | None:
        """In the photo as it stands, in tiles, then turned, until both passes agree on a face."""
        upright = self._detect_at(photo, face)
        upright = upright or self._refine(photo, self.detect_in_tiles(photo.pixels), face, 0)
        if upright is not None and upright.is_consistent:
            return upright
        turned: list[_Detection | None] = []
        for quarters in (1, 3, 2):
            try:
                turned.append(self._detect_at(photo, face, quarters))
            except InputError:
                # Fewer faces in a turned copy matter only where nothing else is found.
                if upright is None and quarters == 2 and not any(turned):
                    raise
        best = min(filter(None, turned), key=lambda detection: detection.shift, default=None)
        if best is None or (upright is not None and best.shift > upright.shift / 2):
            return upright
        return best

    def _detect_at(self, photo: Photo, face: int | None, quarters: int = 0) -> _Detection | None:
        """The face in the photo turned by quarters counterclockwise, in the photo's own pixels."""
        pixels = np.rot90(photo.pixels, quarters)
        small = downscale(pixels, _SEARCH_SIDE)
        faces = self._network.faces(small)
        factor = pixels.shape[1] / small.shape[1]
        return self._refine(photo, [_shifted(found, factor) for found in faces], face, quarters)

    def _refine(
        self, photo: Photo, faces: list[DetectedFace], face: int | None, quarters: int
    ) -> _Detection | None:
        """The chosen face, detected again in a crop around it."""
        if not faces:
            return None
        pixels = np.rot90(photo.pixels, quarters)
        size = pixels.shape[1], pixels.shape[0]
        upright_faces = [_rotated_back(found, quarters, size) for found in faces]
        number, notes = _select_face(upright_faces, face, photo.name)
        near = _detect_in_crop(self, pixels, faces[number], _CROP_SIDE)
        if near is None:
            return _Detection(upright_faces[number], np.inf, quarters, notes)
        offsets = np.linalg.norm((near.points - faces[number].points)[:, :2], axis=1)
        shift = float(np.median(offsets)) / _eye_distance(near)
        return _Detection(_rotated_back(near, quarters, size), shift, quarters, notes)


def refine_small_face(
    detector: LandmarkDetector, pixels: UInt8[Array, "h w 3"], found: DetectedFace
) -> DetectedFace:
    """The face found in a frame; a small one is detected again in a crop around it."""
    if found.width > SMALL_FACE * max(pixels.shape[:2]):
        return found
    return _detect_in_crop(detector, pixels, found) or found


def detect_around(
    detector: LandmarkDetector,
    pixels: UInt8[Array, "h w 3"],
    centre: tuple[float, float],
    radius: float,
) -> list[DetectedFace]:
    """Upright faces in a square crop that reaches `radius` px to each side of a centre."""
    left, top = (max(int(middle - radius), 0) for middle in centre)
    right, bottom = (max(int(middle + radius), 0) for middle in centre)
    crop = np.ascontiguousarray(pixels[top:bottom, left:right])
    if min(crop.shape[:2]) < 2:
        return []
    return [_shifted(face, 1.0, (left, top)) for face in detector.detect_all_fast(crop)]


def _detect_in_crop(
    detector: LandmarkDetector, pixels: Array, found: DetectedFace, side: int | None = None
) -> DetectedFace | None:
    """The same face in a crop around it, reduced to `side` px where that is given."""
    crop, left, top = _crop_around(pixels, found)
    small = np.ascontiguousarray(crop if side is None else downscale(crop, side))
    factor = crop.shape[1] / small.shape[1]
    in_crop = [_shifted(face, factor, (left, top)) for face in detector.detect_all_fast(small)]
    # Somebody else may be larger in the crop.
    near = [face for face in in_crop if is_same_face(face, found)]
    return min(near, key=lambda face: _centre_distance(face, found), default=None)


@dataclass(frozen=True)
class _Detection:
    """A face as found in a photo that was turned for it.

    Attributes:
        shift: median movement between the two passes over the distance between the eyes.
        quarters: by how many quarter turns counterclockwise the photo was turned.
    """

    face: DetectedFace
    shift: float
    quarters: int
    notes: tuple[str, ...]

    @property
    def is_consistent(self) -> bool:
        """Both passes agree and the head is within 60 degrees of upright."""
        up_in_image = -self.face.R_cam_head[1, 1]
        return self.shift < _MAX_SHIFT and bool(up_in_image > 0.5)


def _landmarks(photo: Photo, detection: _Detection) -> Landmarks:
    points = detection.face.points[:, :2]
    notes = [*detection.notes, *cut_note(points, photo.size)]
    if detection.quarters:
        degrees = {1: 90, 2: 180, 3: -90}[detection.quarters]
        notes.append(f"the face was found after turning the photo by {degrees} degrees")
    distance = _eye_distance(detection.face)
    if distance < MIN_EYE_DISTANCE_PX:
        raise EstimationError(
            f"{photo.name}: the face is too small, {distance:.0f} px between the eyes; "
            f"{MIN_EYE_DISTANCE_PX:.0f} are needed, {GOOD_EYE_DISTANCE_PX:.0f} advised"
        )
    if distance < GOOD_EYE_DISTANCE_PX:
        notes.append(
            f"the face is small, {distance:.0f} px between the eyes: expect "
            f"rough landmarks and texture; {GOOD_EYE_DISTANCE_PX:.0f} are advised"
        )
    facing = facing_confidence(detection.face.points, detection.face.R_cam_head)
    return Landmarks(
        points,
        facing * inside_picture(points, photo.size),
        detection.face.blendshapes,
        detection.face.R_cam_head,
        tuple(notes),
    )


def _select_face(
    faces: list[DetectedFace], face: int | None, name: str
) -> tuple[int, tuple[str, ...]]:
    """The index of the largest, or of number `face` from the left; a note if there are several."""
    ordered = sorted(range(len(faces)), key=lambda i: float(faces[i].points[:, 0].mean()))
    if face is not None:
        if face > len(ordered):
            raise InputError("face", f"1 to {len(ordered)}, the faces in {name}", face)
        return ordered[face - 1], ()
    largest = max(ordered, key=lambda i: faces[i].width)
    if len(ordered) == 1:
        return largest, ()
    number = ordered.index(largest) + 1
    note = f"{len(ordered)} faces: number {number} from the left, the largest, is used"
    return largest, (note,)


def is_same_face(one: DetectedFace, other: DetectedFace) -> bool:
    """Whether two detections are of one face."""
    return _centre_distance(one, other) < max(one.width, other.width) / 2


def _centre_distance(one: DetectedFace, other: DetectedFace) -> float:
    """Px between the centroids of two faces."""
    return float(np.linalg.norm((one.points - other.points).mean(axis=0)[:2]))


def _eye_distance(face: DetectedFace) -> float:
    """Px between the irises in 3D, so that a turned head does not seem smaller."""
    return float(np.linalg.norm(face.points[LEFT_IRIS] - face.points[RIGHT_IRIS]))


def _shifted(face: DetectedFace, factor: float, offset: tuple[int, int] = (0, 0)) -> DetectedFace:
    """The face in the pixels of the picture that this one was cut from and scaled."""
    return replace(face, points=face.points * factor + np.array([*offset, 0.0]))


def _crop_around(pixels: Array, face: DetectedFace) -> tuple[Array, int, int]:
    """A square crop around the face, as far as the photo reaches, and its left and top."""
    low, high = face.points[:, :2].min(axis=0), face.points[:, :2].max(axis=0)
    half = _CROP_WIDTHS * face.width / 2
    left, top = np.maximum((low + high) / 2 - half, 0).astype(int)
    right, bottom = np.ceil((low + high) / 2 + half).astype(int)
    return pixels[top:bottom, left:right], int(left), int(top)


def _rotated_back(face: DetectedFace, quarters: int, size: tuple[int, int]) -> DetectedFace:
    """From a photo that was turned by quarters, then of this size, to the photo as it stands."""
    points, rotation = face.points, face.R_cam_head
    width, height = size
    for _ in range(quarters):
        points = points @ _QUARTER.T + np.array([height, 0.0, 0.0])
        rotation = _QUARTER @ rotation
        width, height = height, width
    return replace(face, points=points, R_cam_head=rotation)
