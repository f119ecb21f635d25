"""Skull, cheeks and jaw grown or shrunk to the person's outline in every photo.

Landmarks and matches reach the face; around it the head would be a cap of borrowed size. Where the
drawn head has its outline, the person in the photo should have theirs, hair included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mien.arrays import Array, Bool, Float, Int, UInt8
from mien.assets.generic import GenericHead
from mien.assets.landmark_sets import FACE_OVAL, LANDMARK_COUNT, ON_EDGES
from mien.camera import Camera
from mien.capture.person_mask import PersonMask, find_person
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import rasterize
from mien.reconstruction.dense.surface import cotangent_laplacian
from mien.reconstruction.shape.deformation import with_round_eyes

ROUNDS = 6
OUTWARD_MM, INWARD_MM = 60.0, 15.0
"""How far from the drawn outline that of the person is looked for, where there may be hair."""
SKIN_OUTWARD_MM, SKIN_INWARD_MM = 12.0, 6.0
"""The same on cheeks and jaw, where it is the edge of the skin: hair may hang beside them. A beard
reaches farther in."""
REACH_MM, MEASURED_REACH_MM = (8.0, 28.0), (16.0, 45.0)
"""Skin nearer than this to a feature of the face is known by it, skin farther by its outline; and
of a face that several photos have measured, to any landmark."""
BENDING = 2e3
"""Weight (mm^2) of the squared mean bending of the movement against squared distances."""
_SQUARE = 1.35
"""Side of the square in which the person is looked for, over the head's height or width."""
_FACING = 0.35
"""Cosine to the viewing direction below which skin may be on the outline."""
_RIM_MM = 2.5
"""How near to the outline that counts as being on it."""
_SKIN_SIGMAS = 3.0
"""Colours that differ by more from the face's are no skin."""
_FADE_MM = 80.0
"""Distance over which a movement fades where no outline tells."""
_STEP_MM = 0.5
_DRAWN_SIDE = 600
"""px; of the picture in which the drawn outline is measured."""


def fit_outline(
    vertices: Float[Array, "v 3"],
    views: Sequence[CapturedView],
    cameras: Sequence[Camera],
    generic: GenericHead,
    *,
    measured: bool,
) -> Float[Array, "v 3"]:
    """The head with the outline that its photos show.

    What lies on the drawn outline of a photo moves along its normal to the edge of the person
    there, the rest of the skull and the jaw go along smoothly; the face itself, the ears and the
    neck (whose outline is that of clothes) stay.

    Args:
        vertices: (V, 3) mm.
        views: K photos.
        cameras: of the photos.
        generic: the generic head.
        measured: the face is known from several photos, also where it has no features.
    """
    problem = _OutlineProblem.of(generic, vertices, measured)
    people = [_person(view, camera, vertices) for view, camera in zip(views, cameras, strict=True)]
    moved = vertices
    for _ in range(ROUNDS):
        mesh = generic.mesh.with_vertices(moved)
        found = [
            _targets(view, camera, person, mesh, problem)
            for view, camera, person in zip(views, cameras, people, strict=True)
        ]
        rows = np.concatenate([rim for rim, _ in found])
        distances = np.concatenate([distance for _, distance in found])
        if not len(rows):
            break
        moved = problem.moved(moved, mesh, rows, distances)
    return with_round_eyes(moved, vertices, generic)


def _person(view: CapturedView, camera: Camera, vertices: Float[Array, "v 3"]) -> PersonMask:
    pixels = camera.project(vertices)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    return find_person(view.photo.pixels, (low + high) / 2, _SQUARE * float((high - low).max()))


@dataclass(frozen=True)
class _OutlineProblem:
    """What does not change from round to round.

    Attributes:
        free: (V,) in [0, 1], how far a vertex follows its outline.
        hair: (V,) whether hair may cover it.
        stiffness: (V, V) sparse, of the movement's heights.
        skin: triangles of the skin.
    """

    free: Float[Array, " v"]
    hair: Bool[Array, " v"]
    stiffness: object
    skin: Int[Array, "f 3"]

    @classmethod
    def of(
        cls, generic: GenericHead, vertices: Float[Array, "v 3"], measured: bool
    ) -> _OutlineProblem:
        """For a head with these vertices."""
        from scipy.sparse import diags_array

        numbers = np.arange(LANDMARK_COUNT)
        known = set(range(LANDMARK_COUNT)) - FACE_OVAL if measured else ON_EDGES
        steady = np.isin(numbers, list(known))
        landmarks = generic.landmark_positions(vertices)[generic.landmark_attached & steady]
        distance = cKDTree(landmarks).query(vertices)[0]
        near, far = MEASURED_REACH_MM if measured else REACH_MM
        free = np.clip((distance - near) / (far - near), 0, 1)
        still = ("left_ear", "right_ear", "neck", "eye_socket", "mouth_cavity")
        free *= 1 - np.clip(sum(generic.regions[name] for name in still), 0, 1)
        triangles = generic.mesh.triangles[generic.mesh.triangles_of("skin")]
        on_skin = np.zeros(len(vertices), bool)
        on_skin[triangles] = True
        free *= on_skin
        laplacian, areas = cotangent_laplacian(vertices, triangles)
        held = areas * ((1 - free) * 4.0 + BENDING / _FADE_MM**4)
        stiffness = BENDING * laplacian.T @ diags_array(1 / areas) @ laplacian
        stiffness = stiffness + diags_array(np.where(on_skin, held, 1.0))
        return cls(free, generic.regions["scalp"] > 0.3, stiffness.tocsc(), triangles)

    def moved(
        self,
        vertices: Float[Array, "v 3"],
        mesh: Mesh,
        rows: Int[Array, " r"],
        distances: Float[Array, " r"],
    ) -> Float[Array, "v 3"]:
        """The skin moved along its normals, as near to these distances as smoothness lets it."""
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import splu

        count = len(vertices)
        weights = np.bincount(rows, self.free[rows], minlength=count)
        wanted = np.bincount(rows, self.free[rows] * distances, minlength=count)
        matrix = (self.stiffness + diags_array(10.0 * weights)).tocsc()
        heights = splu(matrix).solve(10.0 * wanted)
        return vertices + heights[:, None] * mesh.vertex_normals()


def _targets(
    view: CapturedView,
    camera: Camera,
    person: PersonMask,
    mesh: Mesh,
    problem: _OutlineProblem,
) -> tuple[Int[Array, " r"], Float[Array, " r"]]:
    """Vertices on a photo's drawn outline, and how far along their normals the person's is, mm."""
    in_camera = camera.to_camera(mesh.vertices)
    pixels = camera.project(mesh.vertices)
    px_per_mm = camera.focal_px / in_camera[:, 2]
    normals = mesh.vertex_normals()
    towards = camera.center - mesh.vertices
    facing = (normals * towards).sum(axis=1) / np.linalg.norm(towards, axis=1)
    rim = np.flatnonzero((np.abs(facing) < _FACING) & (problem.free > 0))
    drawn = _drawn(pixels, in_camera[:, 2], problem.skin)
    rim = rim[_on_outline(pixels[rim], drawn, float(np.median(px_per_mm)))]
    inside = ((pixels[rim] > 0) & (pixels[rim] < [camera.width, camera.height])).all(axis=1)
    rim = rim[inside]
    directions = (normals[rim] @ camera.R_cam_head.T)[:, :2]
    length = np.linalg.norm(directions, axis=1)
    directions /= length[:, None]
    steps = np.arange(-INWARD_MM, OUTWARD_MM + _STEP_MM, _STEP_MM)
    places = pixels[rim][:, None] + (
        steps[None, :, None] * directions[:, None] * px_per_mm[rim][:, None, None]
    )
    within = ((places > 0) & (places < [camera.width, camera.height])).all(axis=2)
    alpha = person.at(places.reshape(-1, 2)).reshape(places.shape[:2])
    bare = ~problem.hair[rim]
    alpha[bare] *= _skin(view.photo.pixels, places[bare], mesh, camera)
    # From edge to edge: the vertex itself lies somewhat inside of the drawn one.
    own = drawn.at(places.reshape(-1, 2)).reshape(places.shape[:2])
    distances = _edge(alpha, steps) - _edge(own, steps)
    column = np.clip(np.searchsorted(steps, distances), 0, len(steps) - 1)
    known = np.isfinite(distances) & within[np.arange(len(rim)), column]
    known[bare] &= (distances[bare] < SKIN_OUTWARD_MM) & (distances[bare] > -SKIN_INWARD_MM)
    # Along the normal in space a step looks shorter in the photo.
    return rim[known], (distances / np.maximum(length, 0.5))[known]


def _drawn(
    pixels: Float[Array, "v 2"], depth: Float[Array, " v"], triangles: Int[Array, "f 3"]
) -> PersonMask:
    """Where the head is drawn."""
    scale = min(1.0, _DRAWN_SIDE / max(float(np.ptp(pixels, axis=0).max()), 1.0))
    low = pixels.min(axis=0) - 4 / scale
    width, height = np.ceil((pixels.max(axis=0) - low) * scale + 4).astype(int)
    raster = rasterize((pixels - low) * scale, depth, triangles, int(width), int(height))
    return PersonMask(raster.mask.astype(np.float32), low, 1 / scale)


def _on_outline(rim: Float[Array, "r 2"], drawn: PersonMask, px_per_mm: float) -> Bool[Array, " r"]:
    """Which of these points lie at the edge of the drawn head."""
    import cv2

    deep = cv2.distanceTransform((drawn.alpha > 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    height, width = deep.shape
    columns, rows = np.floor((rim - drawn.left_top) / drawn.px).astype(int).T
    near = deep[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    return near < max(2.0, _RIM_MM * px_per_mm / drawn.px)


def _edge(alpha: Float[Array, "r s"], steps: Float[Array, " s"]) -> Float[Array, " r"]:
    """Where each row of probabilities falls through a half, next to step 0; NaN where it does not.

    From inside of the person outwards to the first such place, from outside inwards.
    """
    person = alpha > 0.5
    middle = int(np.argmin(np.abs(steps)))
    falls = person[:, :-1] & ~person[:, 1:]
    outward = np.where(falls[:, middle:], np.arange(falls.shape[1] - middle), np.inf).min(axis=1)
    inward = np.where(falls[:, :middle], np.arange(middle), -np.inf).max(axis=1)
    index = np.where(person[:, middle], outward + middle, inward)
    found = np.isfinite(index)
    distances = np.full(len(alpha), np.nan)
    at = index[found].astype(int)
    before, after = alpha[found, at], alpha[found, at + 1]
    share = (before - 0.5) / np.maximum(before - after, 1e-6)
    distances[found] = steps[at] + share * (steps[1] - steps[0])
    return distances


def _skin(
    photo: UInt8[Array, "h w 3"], places: Float[Array, "r s 2"], mesh: Mesh, camera: Camera
) -> Float[Array, "r s"]:
    """1 where a place has the colour of the face, 0 where it does not, smoothed along the steps."""
    from scipy.ndimage import uniform_filter1d

    facing = mesh.vertex_normals() @ (camera.center / np.linalg.norm(camera.center)) > 0.6
    face = _colours(photo, camera.project(mesh.vertices[facing & (mesh.vertices[:, 2] > 0)]))
    centre = np.median(face, axis=0)
    spread = 1.5 * np.median(np.abs(face - centre), axis=0) + 4
    strip = _colours(photo, places.reshape(-1, 2)).reshape(*places.shape[:2], 3)
    alike = (np.abs(strip - centre) / spread).max(axis=2) < _SKIN_SIGMAS
    return uniform_filter1d(alike.astype(float), 3, axis=1)


def _colours(photo: UInt8[Array, "h w 3"], places: Float[Array, "n 2"]) -> Float[Array, "n 3"]:
    """Lightness and colour at points of a photo."""
    import cv2

    columns = np.clip(places[:, 0], 0, photo.shape[1] - 1).astype(int)
    rows = np.clip(places[:, 1], 0, photo.shape[0] - 1).astype(int)
    return cv2.cvtColor(photo[rows, columns][None], cv2.COLOR_RGB2LAB)[0].astype(float)
