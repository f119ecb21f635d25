"""The image of an expression as a mixture of examples, each resampled once."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mien.arrays import Array, Float, UInt8, check_array, frozen
from mien.errors import InputError
from mien.numeric.kernels.threads import for_row_bands
from mien.numeric.planar_similarity import PlanarSimilarity, estimate_planar_similarity
from mien.numeric.raster.piecewise_affine import affine_maps, orient_triangles, to_subpixels
from mien.render.mipmap import packed_texels
from mien.synthesis.composition.blend_weights import pack_blend_weights
from mien.synthesis.composition.border_padding import pad_with_blurred_border
from mien.synthesis.composition.composer_kernels import SUBTEXELS, Mixtures, Photos, draw_rows
from mien.synthesis.examples.example_set import ExampleSet

__all__ = ["Composer"]


class Composer:
    """Draws expressions of one person into the neutral photo.

    The paper aligns examples to the standard image, mixes there and warps the mixture to the new
    points ([Zhang 2006] sections 6 and 7). Here each photo is sampled directly at the position of
    the target's pixel, and blend weights are sampled in the standard image: colours are resampled
    once. Around the subregions, out to the frame of the triangulation, the neutral photo is sampled
    in the same way: hair and neck follow the jaw. Beyond the frame it moves with the head.

    Args:
        examples: photos, their points and the subregions.
        skip: coefficients up to this are left out, and the others are scaled to the same sum. A
            value changes by less than 255 * 2 * skip * number of examples.

    Raises:
        InputError: a photo without two rows and columns, a negative skip.
    """

    def __init__(self, examples: ExampleSet, *, skip: float = 1 / 256) -> None:
        if not 0 <= skip < 1:
            raise InputError("skip", "a share from 0 to below 1", skip)
        layout = examples.layout
        self._layout, self._skip = layout, float(skip)
        self._neutral, self._neutral_points = examples.neutral.photo, examples.neutral.points
        self._frame = frozen(layout.frame(self._neutral_points))
        self._photos = _packed([example.photo for example in examples.examples])
        points = [example.points for example in examples.examples]
        framed = np.stack([self._framed(own, self.head_motion(own)) for own in points])
        self._example_corners = frozen(framed)
        template = np.concatenate([layout.template, layout.template_frame])
        self._triangles = orient_triangles(layout.triangles, template)
        self._standard = examples.standard
        self._blend_weights = pack_blend_weights(examples.subregions.fades)

    def head_motion(self, points: Float[Array, "n 2"]) -> PlanarSimilarity:
        """The head's motion from the neutral photo to another, from the rigid points.

        Args:
            points: (n, 2) px of the other photo.

        Raises:
            InputError: shape, NaN.
            EstimationError: rigid points in one place.

        Source:
            [Zhang 2006] eq. (8), (9). From all points an open jaw would look like a nod.
        """
        points = check_array("points", points, self._neutral_points.shape)
        rigid = self._layout.rigid
        return estimate_planar_similarity(self._neutral_points[rigid], points[rigid])

    def render(
        self,
        points: Float[Array, "n 2"],
        coefficients: Float[Array, "r m"],
        *,
        motion: PlanarSimilarity | None = None,
        size: tuple[int, int] | None = None,
        out: UInt8[Array, "h w 3"] | None = None,
    ) -> UInt8[Array, "h w 3"]:
        """The expression in the neutral photo.

        Args:
            points: (n, 2) px of the picture; they may lie outside.
            coefficients: (R, m) of the examples in each subregion; rows sum to 1.
            motion: of the head, from the neutral photo to the picture; none unless given.
            size: width and height of the picture; the neutral photo's unless given. Beyond its
                edges the neutral photo is continued by `pad_with_blurred_border`.
            out: (h, w, 3) image to draw into; a new one unless given.

        Returns:
            (h, w, 3) sRGB; the same in any number of threads.

        Raises:
            InputError: shapes, NaN, rows that do not sum to 1.

        Source:
            [Zhang 2006] eq. (6), (7), (8).
        """
        points = check_array("points", points, self._neutral_points.shape)
        mixtures = self._mixtures(coefficients)
        corners = to_subpixels(self._framed(points, motion))
        maps = frozen(affine_maps(corners, self._triangles, self._example_corners))
        out = self._background(motion, size, out)
        height, width = out.shape[:2]

        def draw(first: int, end: int) -> None:
            mesh = (corners, self._triangles, maps, self._photos, self._standard)
            draw_rows(*mesh, self._blend_weights, mixtures, first, end, out)

        for_row_bands(draw, height, work=4 * width * height)
        return out

    def _framed(
        self, points: Float[Array, "n 2"], motion: PlanarSimilarity | None
    ) -> Float[Array, "k 2"]:
        """All corners of the triangles: the points, and the neutral photo's frame, moved."""
        frame = self._frame if motion is None else motion(self._frame)
        return np.concatenate([points, frame])

    @cached_property
    def _padded(self) -> tuple[UInt8[Array, "k l 3"], int]:
        """For heads that move: the neutral photo with its border, and the border's width, px."""
        return pad_with_blurred_border(self._neutral)

    def _background(
        self,
        motion: PlanarSimilarity | None,
        size: tuple[int, int] | None,
        out: UInt8[Array, "h w 3"] | None,
    ) -> UInt8[Array, "h w 3"]:
        """The neutral photo moved with the head, in a new image unless one is given."""
        import cv2

        width, height = size or self._neutral.shape[1::-1]
        if min(width, height) < 1:
            raise InputError("size", "a width and height of at least 1", size)
        if out is None:
            out = np.empty((height, width, 3), np.uint8)
        fits = out.shape == (height, width, 3) and out.dtype == np.uint8
        if not (fits and out.flags.c_contiguous and out.flags.writeable):
            raise InputError("out", f"a writable {width}x{height} image", f"{out.shape}")
        if motion is None and out.shape == self._neutral.shape:
            np.copyto(out, self._neutral)
            return out
        # The centre of OpenCV's first pixel is 0, ours 0.5.
        corners = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5]])
        origin, right, down = (corners if motion is None else motion(corners)) - 0.5
        matrix = np.stack([right - origin, down - origin, origin], axis=1)
        padded, margin = self._padded
        matrix[:, 2] -= margin * matrix[:, :2].sum(axis=1)
        cv2.warpAffine(padded, matrix, (width, height), out, borderMode=cv2.BORDER_REPLICATE)
        return out

    def _mixtures(self, coefficients: Float[Array, "r m"]) -> Mixtures:
        table = self._blend_weights.table
        shape = (table.shape[1] - 1, len(self._photos.starts))
        coefficients = check_array("coefficients", coefficients, shape)
        sums = coefficients.sum(1)
        if np.abs(sums - 1).max() > 1e-3:
            worst = int(np.abs(sums - 1).argmax())
            raise InputError("coefficients", "rows that sum to 1", f"{sums[worst]} in {worst}")
        # The background is neutral.
        coefficients = np.vstack([coefficients, np.eye(1, shape[1])])
        kept = np.where(np.abs(coefficients) > self._skip, coefficients, 0.0)
        # Where all are small, none is left out.
        empty = np.abs(kept.sum(1)) < 0.5
        kept[empty] = coefficients[empty]
        kept /= SUBTEXELS * kept.sum(1, keepdims=True)
        counts = table @ (kept != 0)
        return Mixtures(
            frozen(kept.astype(np.float32)),
            frozen(np.concatenate([[0], np.cumsum(counts.sum(1))]).astype(np.int32)),
            frozen(np.nonzero(counts)[1].astype(np.int32)),
        )


def _packed(photos: list[UInt8[Array, "h w 3"]]) -> Photos:
    sizes = np.array([photo.shape[:2] for photo in photos], np.int64)
    if sizes.min() < 2:
        raise InputError("photos", "at least two rows and columns", f"{sizes.min()}")
    texels = np.concatenate([packed_texels(photo) for photo in photos])
    starts = np.concatenate([[0], np.cumsum(sizes.prod(1))[:-1]])
    heights, widths = sizes.T.copy()
    return Photos(frozen(texels), frozen(starts), frozen(widths), frozen(heights))
