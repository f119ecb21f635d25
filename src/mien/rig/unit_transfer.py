"""Transfer of the generic head's face units to a person's head.

With J the local affine map from the generic head to the person's, the difference U_i - U_j of a
unit's offsets along an edge becomes J (U_i - U_j). Vertices that the generic unit does not move are
fixed; the others are the solution of one sparse least-squares problem a unit.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags

from mien.arrays import Array, Bool, Float, Int, check_array
from mien.assets.generic import GenericHead
from mien.rig.followers import Followers
from mien.rig.skin_paths import shortest_path, skin_edges

_SIGMA_MM = 12.0
"""Standard deviation of the neighbourhood over which the local stretch is estimated."""
_RIDGE = 0.05
"""Ridge towards the whole head's stretch: a flat neighbourhood does not determine its normal's."""
_STILL_MM = 1e-4
_MIN_WEIGHT = 0.02
_LINK = 1.0
"""Weight of a link across mouth or eyes; an edge of an equilateral triangle weighs 0.58."""
_OPENINGS = (
    ("upper_lip_inner", "lower_lip_inner"),
    ("left_upper_eyelid", "left_lower_eyelid"),
    ("right_upper_eyelid", "right_lower_eyelid"),
)
_RIGID = ("left_eyeball", "right_eyeball", "upper_teeth", "lower_teeth", "tongue")
_JAW_PARTS = ("lower_teeth", "tongue")
_CHIN_MM = 30.0


def transfer_units(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "52 v 3"]:
    """(52, V, 3) float32 mm: what each generic unit adds to this head's vertices at weight 1.

    Exact for every affine image of the generic head: its units are the generic ones, mapped alike.
    Contacts of lids and lips are not resolved here (see rig.contacts).

    Args:
        generic: the head whose units are transferred.
        vertices: (V, 3) mm, head space, the generic topology; the neutral face.

    Raises:
        InputError: shape, NaN.

    Source:
        after Sumner and Popovic, Deformation transfer for triangle meshes, SIGGRAPH 2004; differs
        in that gradients are those of the generic mesh, which has no degenerate triangles, mapped
        by the stretch between the heads, so that amplitudes follow its proportions.
    """
    vertices = check_array("vertices", vertices, generic.mesh.vertices.shape)
    stretch = local_stretch(generic, vertices)
    units = generic.unit_offsets.astype(np.float64)
    stretched = np.einsum("vij,kvj->kvi", stretch, units)
    skin = generic.mesh.vertices_of("skin")
    result = np.zeros_like(units)
    result[:, skin] = _integrated(generic, skin, stretch, units, stretched)
    deviation = result - stretched
    followers = Followers.of(generic)
    result[:, followers.vertices] = stretched[:, followers.vertices] + followers.carried(deviation)
    for name in _RIGID:
        part = generic.mesh.vertices_of(name)
        linear = _affine(generic.mesh.vertices[part], vertices[part])
        result[:, part] = units[:, part] @ linear.T
    _follow_jaw(generic, units, deviation, result)
    return result.astype(np.float32)


def local_stretch(generic: GenericHead, vertices: Float[Array, "v 3"]) -> Float[Array, "v 3 3"]:
    """The linear part of the affine map from the generic head to this one around every vertex.

    Fitted to the skin by least squares, weighted by a Gaussian of the distance on the generic head
    with a ridge towards the affine map of the whole head.
    """
    from scipy.spatial import cKDTree

    source = generic.mesh.vertices
    skin = generic.mesh.vertices_of("skin")
    whole = _affine(source[skin], vertices[skin])
    tree = cKDTree(source[skin])
    pairs = tree.sparse_distance_matrix(cKDTree(source), 2 * _SIGMA_MM, output_type="coo_matrix")
    near = np.exp(-0.5 * (pairs.data / _SIGMA_MM) ** 2)
    weights = csr_matrix((near, (pairs.col, pairs.row)), (len(source), len(skin)))
    left = (vertices - source @ whole.T)[skin]
    moments = _moments(weights, source[skin], left)
    covariance, cross = moments[..., :3], moments[..., 3:]
    size = np.trace(covariance, axis1=1, axis2=2)[:, None, None] / 3
    ridge = _RIDGE * size * np.eye(3) + 1e-9 * np.eye(3)
    correction = np.linalg.solve(covariance + ridge, cross)
    return whole + np.swapaxes(correction, 1, 2)


def _moments(
    weights: csr_matrix, source: Float[Array, "n 3"], target: Float[Array, "n 3"]
) -> Float[Array, "v 3 6"]:
    """Weighted central second moments of the source with itself and with the target."""
    both = np.hstack([source, target])
    products = (source[:, :, None] * both[:, None, :]).reshape(len(source), 18)
    total = np.maximum(np.asarray(weights.sum(axis=1)), 1e-12)
    mean = (weights @ both) / total
    second = ((weights @ products) / total).reshape(-1, 3, 6)
    return second - mean[:, :3, None] * mean[:, None, :]


def _affine(source: Float[Array, "n 3"], target: Float[Array, "n 3"]) -> Float[Array, "3 3"]:
    """Linear part of the affine map that takes source nearest to target."""
    centred = source - source.mean(axis=0)
    found = np.linalg.lstsq(centred, target - target.mean(axis=0), rcond=None)[0]
    return found.T


def _integrated(
    generic: GenericHead,
    skin: Int[Array, " s"],
    stretch: Float[Array, "v 3 3"],
    units: Float[Array, "k v 3"],
    stretched: Float[Array, "k v 3"],
) -> Float[Array, "k s 3"]:
    """The skin's offsets whose differences along edges come nearest to the stretched ones."""
    from scipy.sparse.linalg import splu

    laplacian = skin_laplacian(generic, skin)
    local = stretch[skin]
    bend = (laplacian @ local.reshape(-1, 9)).reshape(-1, 3, 3)
    result = np.zeros((len(units), len(skin), 3))
    for unit, (raw, moved) in enumerate(zip(units[:, skin], stretched[:, skin], strict=True)):
        free = np.flatnonzero(np.abs(raw).max(axis=1) > _STILL_MM)
        if not len(free):
            continue
        # sum_j w_ij (J_i + J_j) / 2 (U_i - U_j), by products with the Laplacian; moved is J U.
        turned = np.einsum("vij,vj->vi", local, laplacian @ raw)
        right = (turned + laplacian @ moved - np.einsum("vij,vj->vi", bend, raw)) / 2
        inner = laplacian[free][:, free].tocsc()
        result[unit, free] = splu(inner).solve(right[free])
    return result


def skin_laplacian(generic: GenericHead, skin: Int[Array, " s"]) -> csr_matrix:
    """(S, S) cotangent Laplacian of the generic skin, with links across mouth and eyes.

    Weights are bounded below, so that it stays definite.
    """
    index = np.full(len(generic.mesh.vertices), -1)
    index[skin] = np.arange(len(skin))
    pairs, weights = _edges(generic)
    links = _links(generic)
    a, b = index[np.concatenate([pairs, links])].T
    weights = np.concatenate([weights, np.full(len(links), _LINK)])
    place = (np.concatenate([a, b]), np.concatenate([b, a]))
    values = np.concatenate([weights, weights])
    adjacency = coo_matrix((values, place), (len(skin), len(skin))).tocsr()
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return csr_matrix(diags(degree) - adjacency)


def _edges(generic: GenericHead) -> tuple[Int[Array, "e 2"], Float[Array, " e"]]:
    """The skin's edges, once for every triangle, and half the cotangents opposite to them."""
    mesh = generic.mesh
    triangles = mesh.triangles[mesh.triangles_of("skin")]
    corners = mesh.vertices[triangles]
    pairs, weights = [], []
    for corner in range(3):
        a, b = (corner + 1) % 3, (corner + 2) % 3
        to_a, to_b = corners[:, a] - corners[:, corner], corners[:, b] - corners[:, corner]
        area = np.linalg.norm(np.cross(to_a, to_b), axis=1)
        cotangent = (to_a * to_b).sum(axis=1) / area
        pairs.append(triangles[:, [a, b]])
        weights.append(np.maximum(cotangent, _MIN_WEIGHT) / 2)
    return np.concatenate(pairs), np.concatenate(weights)


def _links(generic: GenericHead) -> Int[Array, "l 2"]:
    """Pairs of vertices across mouth and eyes, so that their opening is transferred too."""
    from scipy.spatial import cKDTree

    places = generic.mesh.vertices
    edges = skin_edges(generic, places)
    pairs = []
    for opening in _OPENINGS:
        upper, lower = (shortest_path(edges, generic.polylines[name])[1:-1] for name in opening)
        for line, other in ((upper, lower), (lower, upper)):
            nearest = other[cKDTree(places[other]).query(places[line])[1]]
            pairs.append(np.column_stack([line, nearest]))
    return np.concatenate(pairs)


def _follow_jaw(
    generic: GenericHead,
    units: Float[Array, "k v 3"],
    deviation: Float[Array, "k v 3"],
    result: Float[Array, "k v 3"],
) -> None:
    """Adds to lower teeth and tongue the chin's deviation from the stretched generic motion."""
    chin = _chin(generic)
    teeth = generic.mesh.vertices_of("lower_teeth")
    jaw = np.abs(units[:, teeth]).max(axis=(1, 2)) > 1.0
    extra = deviation[:, chin].mean(axis=1)
    for name in _JAW_PARTS:
        result[np.ix_(jaw, generic.mesh.vertices_of(name))] += extra[jaw, None]


def _chin(generic: GenericHead) -> Int[Array, " c"]:
    """Skin that lies on the lower jaw's front."""
    skin = generic.mesh.vertices_of("skin")
    distance = np.linalg.norm(
        generic.mesh.vertices[skin] - generic.mesh.vertices[generic.vertex_of("chin")], axis=1
    )
    near: Bool[Array, " s"] = distance < _CHIN_MM
    return skin[near]
