"""Which pixels of a photo show the person: hair, neck and clothes included, the wall not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.assets.networks import person_model_path
from mien.numeric.images.sampling import sample_bilinear

_SIDE = 256
"""px; of the network's input and output."""
_WIDTHS = (1.0, 1.5)
"""Squares that the network sees, over the one asked for. A wide one knows what is a person, a
narrow one where the edge is; their mean has fewer patches of wall than either."""
_MAX_SIDE = 768
"""px; of a mask. A finer one would show nothing that the network knows."""
_GUIDE_RADIUS, _GUIDE_EDGE = 0.02, 0.03
"""Of the guided filter: radius over the square's side, and the contrast (of 1) that is an edge."""


@dataclass(frozen=True)
class PersonMask:
    """Where a square of a photo shows the person.

    Attributes:
        alpha: (h, w) float32, the probability, sharpened along the photo's edges.
        left_top: (2,) px of the photo, of the corner of alpha's first pixel.
        px: px of the photo that one of alpha's is wide.
    """

    alpha: Float[Array, "h w"]
    left_top: Float[Array, " 2"]
    px: float

    def at(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """The probability at points of the photo, px; 0 outside of the square."""
        places = (points - self.left_top) / self.px
        height, width = self.alpha.shape
        inside = ((places > 0) & (places < [width, height])).all(axis=1)
        return np.where(inside, sample_bilinear(self.alpha[..., None], places)[:, 0], 0.0)

    def of_photo(self, width: int, height: int) -> Bool[Array, "h w"]:
        """(H, W) of a photo of this size, where the person is likelier than not."""
        import cv2

        to_photo = np.array([[self.px, 0, self.left_top[0]], [0, self.px, self.left_top[1]]])
        # OpenCV counts from the centre of the first pixel.
        to_photo[:, 2] += (self.px - 1) / 2
        flags = cv2.INTER_LINEAR
        return cv2.warpAffine(self.alpha, to_photo, (width, height), flags=flags) > 0.5


def find_person(
    pixels: UInt8[Array, "h w 3"], centre: Float[Array, " 2"], side: float
) -> PersonMask:
    """The person whose head is in the middle of a square of a photo.

    Args:
        pixels: of the photo.
        centre: px of the photo.
        side: px; best some twice the height of the face, so that the square holds all of the head.

    Source:
        MediaPipe's selfie segmentation, sharpened by He et al., Guided Image Filtering, 2013.
    """
    import cv2

    count = int(min(max(side, 16), _MAX_SIDE))
    left_top, px = centre - side / 2, side / count
    crop = _square(pixels, centre, side, count)
    probability = np.mean([_network(pixels, centre, side, width, count) for width in _WIDTHS], 0)
    radius = max(1, round(_GUIDE_RADIUS * count))
    sharp = cv2.ximgproc.guidedFilter(
        crop, probability.astype(np.float32), radius, (255 * _GUIDE_EDGE) ** 2
    )
    sharp = np.clip(sharp, 0, 1) * _connected(sharp > 0.5) * _inside(pixels, left_top, px, count)
    return PersonMask(sharp.astype(np.float32), left_top, px)


def _network(
    pixels: Array, centre: Float[Array, " 2"], side: float, width: float, count: int
) -> Float[Array, "count count"]:
    """Its mean answer to a square and the mirrored one, in the pixels of the narrowest one."""
    import cv2

    square = _square(pixels, centre, width * side, _SIDE).astype(np.float32) / 255
    both = np.stack([square, square[:, ::-1]]).transpose(0, 3, 1, 2)
    network = cv2.dnn.readNetFromTFLite(str(person_model_path()))
    network.setInput(np.ascontiguousarray(both))
    plain, mirrored = network.forward().reshape(2, _SIDE, _SIDE)
    answer = (plain + mirrored[:, ::-1]) / 2
    middle = np.full(2, _SIDE / 2)
    return _square(answer, middle, _SIDE / width, count)


def _square(image: Array, centre: Float[Array, " 2"], side: float, count: int) -> Array:
    """A square of the image in count x count pixels; the image's border continues outside."""
    import cv2

    scale = count / side
    to_square = np.array([[scale, 0, 0], [0, scale, 0]])
    to_square[:, 2] = count / 2 - scale * centre + (scale - 1) / 2
    if scale < 0.5:
        # Averaged first: a warp alone would skip pixels.
        factor = max(1, int(1 / scale))
        height, width = image.shape[0] // factor, image.shape[1] // factor
        small = cv2.resize(
            image[: height * factor, : width * factor],
            (width, height),
            interpolation=cv2.INTER_AREA,
        )
        return _square(small, centre / factor, side / factor, count)
    return cv2.warpAffine(
        image, to_square, (count, count), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )


def _connected(mask: Bool[Array, "h w"]) -> Bool[Array, "h w"]:
    """The part of the mask that holds most of its middle: somebody else is another part."""
    import cv2

    _, labels = cv2.connectedComponents(mask.astype(np.uint8))
    third = len(mask) // 3
    middle = labels[third : 2 * third, third : 2 * third]
    counts = np.bincount(middle[middle > 0], minlength=2)
    return labels == counts.argmax() if counts.any() else np.zeros(mask.shape, bool)


def _inside(
    pixels: Array, left_top: Float[Array, " 2"], px: float, count: int
) -> Bool[Array, "count count"]:
    """Which pixels of the square lie in the photo."""
    height, width = pixels.shape[:2]
    columns, rows = (left_top[axis] + px * (np.arange(count) + 0.5) for axis in (0, 1))
    return ((rows > 0) & (rows < height))[:, None] & ((columns > 0) & (columns < width))
