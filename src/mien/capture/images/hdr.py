"""HDR pictures, coded in HLG or PQ (ITU-R BT.2100), as 8-bit sRGB.

What a display would show of them, in linear light: for PQ as coded, for HLG through the OOTF of a
display of 1,000 cd/m2. White of ordinary video lies at 203 cd/m2 there (BT.2408) and becomes 1, the
primaries become sRGB's. Up to `KNEE` nothing else happens, so that a face keeps the tones that it
has in ordinary video; what is brighter is compressed into the rest, its hue kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mien.arrays import Array, Float, UInt8, UInt16
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands

PQ, HLG = 16, 18
"""Codes of the transfer characteristics in ISO/IEC 23091-2, as FFmpeg gives them."""
HDR = {PQ: "PQ", HLG: "HLG"}

WHITE = 203.0
"""cd/m2 of ordinary video's white."""
PEAK = 1000.0
"""cd/m2 that become the brightest white; HLG's own, and what most PQ clips are graded for."""
KNEE = 0.9
"""sRGB-coded value above which highlights are compressed."""

_GAMMA = 1.2
_STEPS = 4096
_LUMINANCE = np.array([0.2627, 0.6780, 0.0593])
_BT709, _P3, _BT2020 = 1, 12, 9
# From linear RGB of these primaries, white D65, to that of BT.709.
_TO_SRGB = {
    _BT709: np.eye(3),
    _P3: np.array(
        [[1.22494, -0.22494, 0.0], [-0.04206, 1.04206, 0.0], [-0.01964, -0.07864, 1.09828]]
    ),
    _BT2020: np.array(
        [
            [1.66049, -0.58764, -0.07285],
            [-0.12455, 1.13290, -0.00835],
            [-0.01815, -0.10058, 1.11873],
        ]
    ),
}


def hdr_to_srgb(
    codes: UInt16[Array, "h w 3"], transfer: int, primaries: int
) -> UInt8[Array, "h w 3"]:
    """HDR pixels as sRGB.

    Args:
        codes: R'G'B' over the full range of 16 bits.
        transfer: PQ or HLG.
        primaries: by their code in ISO/IEC 23091-2; BT.2020's where unknown.
    """
    tables = _tables(transfer)
    matrix = _TO_SRGB.get(primaries, _TO_SRGB[_BT2020]).astype(np.float32)
    out = np.empty(codes.shape, np.uint8)

    def band(first: int, end: int) -> None:
        _map(
            codes[first:end],
            tables.linear,
            tables.system,
            matrix,
            tables.gain,
            tables.coded,
            out[first:end],
        )

    for_row_bands(band, len(codes), work=codes.shape[0] * codes.shape[1])
    return out


@dataclass(frozen=True)
class _Tables:
    """Lookup tables of a transfer characteristic.

    Attributes:
        linear: of a code, scene light in [0, 1] for HLG, display light over WHITE for PQ.
        system: what scene light is multiplied by, by the root of its luminance; ones for PQ.
        gain: for highlights, by the root of the largest channel over the peak.
        coded: sRGB in [0, 255] by the root of linear light.
    """

    linear: Float[Array, " n"]
    system: Float[Array, " n"]
    gain: Float[Array, " n"]
    coded: UInt8[Array, " n"]


@cache
def _tables(transfer: int) -> _Tables:
    steps = np.linspace(0, 1, _STEPS)
    system = np.ones(_STEPS)
    if transfer == HLG:
        linear = _scene_light(steps)
        system = PEAK / WHITE * (steps**2) ** (_GAMMA - 1)
    else:
        linear = _pq_light(steps) / WHITE
    largest = steps**2 * (PEAK / WHITE)
    code = _srgb(largest)
    # Of slope 1 at the knee, 1 at the peak.
    above, room, most = np.maximum(code - KNEE, 0), 1 - KNEE, _srgb(np.array(PEAK / WHITE)) - KNEE
    rolled = np.minimum(code, KNEE) + above / (1 + above * (1 / room - 1 / most))
    gain = _srgb_light(rolled) / np.maximum(largest, 1e-9)
    gain[code <= KNEE] = 1
    coded = np.rint(255 * _srgb(steps**2)).astype(np.uint8)
    single = np.float32
    return _Tables(linear.astype(single), system.astype(single), gain.astype(single), coded)


def _scene_light(signal: Float[Array, " n"]) -> Float[Array, " n"]:
    """HLG's inverse OETF."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    return np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12)


def _pq_light(signal: Float[Array, " n"]) -> Float[Array, " n"]:
    """PQ's EOTF, cd/m2."""
    m1, m2 = 2610 / 16384, 2523 / 4096 * 128
    c1, c2, c3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
    power = signal ** (1 / m2)
    return 10_000 * (np.maximum(power - c1, 0) / (c2 - c3 * power)) ** (1 / m1)


def _srgb(linear: Array) -> Array:
    """Coded as sRGB, which is continued above 1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _srgb_light(coded: Array) -> Array:
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


@njit(cache=True, nogil=True)
def _step(light, last):  # type: ignore[no-untyped-def]
    """The entry of a table by roots of light."""
    return int(np.sqrt(min(light, np.float32(1))) * last + np.float32(0.5))


@njit(cache=True, nogil=True)
def _map(codes, linear, system, matrix, gain, coded, out):  # type: ignore[no-untyped-def]
    last, dark, room = np.float32(_STEPS - 1), np.float32(0), np.float32(WHITE / PEAK)
    weights = _LUMINANCE.astype(np.float32)
    for row in range(codes.shape[0]):
        for column in range(codes.shape[1]):
            r = linear[codes[row, column, 0] >> 4]
            g = linear[codes[row, column, 1] >> 4]
            b = linear[codes[row, column, 2] >> 4]
            factor = system[_step(weights[0] * r + weights[1] * g + weights[2] * b, last)]
            r, g, b = r * factor, g * factor, b * factor
            red = max(matrix[0, 0] * r + matrix[0, 1] * g + matrix[0, 2] * b, dark)
            green = max(matrix[1, 0] * r + matrix[1, 1] * g + matrix[1, 2] * b, dark)
            blue = max(matrix[2, 0] * r + matrix[2, 1] * g + matrix[2, 2] * b, dark)
            factor = gain[_step(max(red, green, blue) * room, last)]
            out[row, column, 0] = coded[_step(red * factor, last)]
            out[row, column, 1] = coded[_step(green * factor, last)]
            out[row, column, 2] = coded[_step(blue * factor, last)]
