"""The skull under the hair, which photos hardly show.

MakeHuman's sliders for the head's outline make its crown square or pointed; what a face says about
them does not carry over to a real skull. So the scalp follows the rest of the head smoothly.
"""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float, Int
from mien.numeric.rbf import fit_rbf
from tools.assets.head import HeadCut

_SAMPLES_A_SIDE = 125
_SMOOTHING = 0.01


def follow_with_scalp(
    offsets: Float[Array, "n v 3"],
    head: HeadCut,
    scalp: Float[Array, " v"],
    hidden: Float[Array, " v"],
) -> Float[Array, "n v 3"]:
    """Offsets of heads with the scalp's extended from the skin around it ([Pighin 2002] eq. 3).

    Args:
        scalp: (V,) share of a vertex that follows; hair takes that of the skin below.
        hidden: (V,) above 0 inside the mouth and behind the lids, which say nothing of the skull.
    """
    samples = _spread_over(head, (scalp < 0.01) & (hidden < 0.01))
    known = offsets[:, samples].transpose(1, 0, 2).reshape(len(samples), -1)
    extend = fit_rbf(head.vertices[samples], known, smoothing=_SMOOTHING)
    follows = np.zeros(head.source.max() + 1)
    np.maximum.at(follows, head.source, scalp)
    share = follows[head.source]
    moved = np.flatnonzero(share > 0)
    extended = extend(head.vertices[moved]).reshape(len(moved), len(offsets), 3)
    result = offsets.copy()
    weight = share[moved][None, :, None]
    result[:, moved] += weight * (extended.transpose(1, 0, 2) - offsets[:, moved])
    return result


def _spread_over(head: HeadCut, allowed: Array) -> Int[Array, " n"]:
    """Skin vertices far from each other, the same on both sides."""
    skin = head.vertices_of("skin")
    pool = skin[allowed[skin] & (head.vertices[skin, 0] >= 0)]
    chosen = [int(pool[0])]
    distance = np.full(len(pool), np.inf)
    for _ in range(_SAMPLES_A_SIDE - 1):
        step = np.linalg.norm(head.vertices[pool] - head.vertices[chosen[-1]], axis=1)
        distance = np.minimum(distance, step)
        chosen.append(int(pool[distance.argmax()]))
    return np.unique(np.concatenate([chosen, head.mirror[chosen]]))
