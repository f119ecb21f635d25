"""The generic head that ships with mien."""

from __future__ import annotations

import hashlib
from importlib.resources import files

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mien.assets.generic as generic
from mien.assets.generic import GenericHead, load_generic_head
from mien.errors import FileFormatError, InputError
from mien.numeric.raster.rasterizer import rasterize

FLIP = np.array([-1.0, 1.0, 1.0])
PARTS = (
    "skin",
    "left_eyeball",
    "right_eyeball",
    "upper_teeth",
    "lower_teeth",
    "tongue",
    "lashes",
    "hair",
)
POLYLINE_LENGTHS = {
    "eyebrow_upper": 5,
    "eyebrow_lower": 5,
    "upper_eyelid": 7,
    "lower_eyelid": 7,
    "nostril": 5,
    "jaw": 7,
    "ear": 7,
}
SINGLE_LENGTHS = {
    "upper_lip_outer": 9,
    "lower_lip_outer": 9,
    "upper_lip_inner": 7,
    "lower_lip_inner": 7,
    "nose_ridge": 5,
    "hairline": 9,
}
POINTS = {
    *("nose_root", "nose_tip", "chin"),
    *(f"{side}_eye_{end}" for side in ("left", "right") for end in ("inner", "outer")),
    *(f"{side}_{name}" for side in ("left", "right") for name in ("nose_wing", "mouth_corner")),
    *("left_ear_lobe", "right_ear_lobe"),
}


@pytest.fixture(scope="module")
def head() -> GenericHead:
    return load_generic_head()


def partner(name: str) -> str:
    for side, other in (("left", "right"), ("right", "left"), ("Left", "Right"), ("Right", "Left")):
        if name.startswith(f"{side}_"):
            return other + name.removeprefix(side)
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name


class TestMesh:
    def test_parts_come_in_the_agreed_order_and_share_no_vertex(self, head: GenericHead) -> None:
        assert head.mesh.part_names == PARTS
        owners = [head.mesh.vertices_of(part) for part in PARTS]
        assert_array_equal(np.concatenate(owners), np.arange(len(head.mesh.vertices)))

    def test_the_eyes_set_origin_and_scale(self, head: GenericHead) -> None:
        left, right = (
            head.mesh.vertices[head.mesh.vertices_of(f"{side}_eyeball")].mean(0)
            for side in ("left", "right")
        )
        assert_allclose(left, [31.5, 0, 0], atol=1e-4)
        assert_allclose(right, [-31.5, 0, 0], atol=1e-4)

    def test_the_neck_ends_in_one_clean_ring(self, head: GenericHead) -> None:
        triangles = head.mesh.triangles[head.mesh.triangles_of("skin")]
        edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        _, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        assert set(count) == {1, 2}
        rim = np.unique(np.sort(edges, axis=1), axis=0)[count == 1]
        vertices, uses = np.unique(rim, return_counts=True)
        assert set(uses) == {2}
        assert head.mesh.vertices[vertices, 1].max() < -140

    def test_the_skin_faces_outwards(self, head: GenericHead) -> None:
        tip = head.vertex_of("nose_tip")
        assert head.mesh.vertex_normals()[tip, 2] > 0.5

    def test_uvs_lie_in_the_square_and_no_triangle_is_flipped(self, head: GenericHead) -> None:
        uvs = head.mesh.uvs
        assert uvs.min() >= 0
        assert uvs.max() <= 1
        a, b, c = (uvs[head.mesh.uv_triangles[:, corner]] for corner in range(3))
        doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        assert doubled.min() > 0

    def test_no_texel_belongs_to_two_triangles(self, head: GenericHead) -> None:
        """Every part covers as many texels as the areas of its triangles add up to."""
        size = 1024
        pixels = head.mesh.uvs * size
        together = rasterize(pixels, np.ones(len(pixels)), head.mesh.uv_triangles, size, size)
        a, b, c = (pixels[head.mesh.uv_triangles[:, corner]] for corner in range(3))
        doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        for index in range(len(PARTS)):
            covered = together.mask & (head.mesh.part[together.triangle_ids] == index)
            area = doubled[head.mesh.part == index].sum() / 2
            assert covered.sum() == pytest.approx(area, rel=0.01)


class TestMirror:
    def test_is_an_involution_that_mirrors_positions(self, head: GenericHead) -> None:
        assert_array_equal(head.mirror[head.mirror], np.arange(len(head.mirror)))
        mirrored = head.mesh.vertices[head.mirror] * FLIP
        assert_allclose(head.mesh.vertices, mirrored, atol=1e-3)

    def test_maps_triangles_onto_triangles_of_the_partner_part(self, head: GenericHead) -> None:
        part_of = {
            frozenset(triangle): head.mesh.part_names[part]
            for triangle, part in zip(head.mesh.triangles.tolist(), head.mesh.part, strict=True)
        }
        for triangle, part in part_of.items():
            mirrored = frozenset(int(head.mirror[vertex]) for vertex in triangle)
            assert part_of[mirrored] == partner(part)

    def test_pairs_units(self, head: GenericHead) -> None:
        for name, offsets in zip(head.unit_names, head.unit_offsets, strict=True):
            other = head.unit_offsets[head.unit_names.index(partner(name))]
            assert_allclose(offsets, other[head.mirror] * FLIP, atol=1e-4, err_msg=name)

    def test_pairs_features(self, head: GenericHead) -> None:
        for name, vertex in head.points.items():
            assert head.mirror[vertex] == head.points[partner(name)]
        for name, line in head.polylines.items():
            mirrored = tuple(int(head.mirror[vertex]) for vertex in line)
            single = name in SINGLE_LENGTHS and name != "nose_ridge"
            assert mirrored == (line[::-1] if single else head.polylines[partner(name)])


class TestUnits:
    def test_are_the_52_of_arkit(self, head: GenericHead) -> None:
        assert len(head.unit_names) == 52
        assert list(head.unit_names) == sorted(head.unit_names)
        assert {"jawOpen", "eyeBlinkLeft", "tongueOut"} <= set(head.unit_names)

    def test_jaw_open_lowers_chin_lower_teeth_and_tongue_only(self, head: GenericHead) -> None:
        offsets = head.unit_offsets[head.unit_names.index("jawOpen")]
        assert offsets[head.points["chin"], 1] < -15
        assert offsets[head.mesh.vertices_of("lower_teeth"), 1].mean() < -10
        assert offsets[head.mesh.vertices_of("tongue"), 1].mean() < -5
        assert_array_equal(offsets[head.mesh.vertices_of("upper_teeth")], 0)

    def test_the_left_blink_closes_the_subjects_left_eye(self, head: GenericHead) -> None:
        offsets = head.unit_offsets[head.unit_names.index("eyeBlinkLeft")]
        closed = head.mesh.vertices + offsets
        upper, lower = (list(head.polylines[f"left_{e}_eyelid"]) for e in ("upper", "lower"))
        assert closed[upper[3], 1] == pytest.approx(closed[lower[3], 1], abs=0.6)
        assert_array_equal(offsets[list(head.polylines["right_upper_eyelid"])], 0)

    def test_looking_left_turns_the_eyeball(self, head: GenericHead) -> None:
        offsets = head.unit_offsets[head.unit_names.index("eyeLookOutLeft")]
        eye = head.mesh.vertices_of("left_eyeball")
        front = eye[head.mesh.vertices[eye, 2].argmax()]
        assert offsets[front, 0] > 3
        assert_array_equal(offsets[head.mesh.vertices_of("right_eyeball")], 0)


class TestIdentity:
    def test_keeps_the_eyes_centres(self, head: GenericHead, rng: np.random.Generator) -> None:
        offsets = head.identity.offsets(rng.normal(size=len(head.identity.components)))
        for side in ("left", "right"):
            moved = offsets[head.mesh.vertices_of(f"{side}_eyeball")].mean(0)
            assert_allclose(moved, 0, atol=0.05)

    def test_components_are_symmetric_or_antisymmetric(self, head: GenericHead) -> None:
        for component in head.identity.components:
            mirrored = component[head.mirror] * FLIP
            sign = np.sign((component * mirrored).sum())
            assert_allclose(component, sign * mirrored, atol=0.02)

    def test_components_are_independent_and_sorted(self, head: GenericHead) -> None:
        """Orthogonal in the metric that counts the face, so that coefficients are uncorrelated."""
        weights = 0.05 + head.regions["face"].astype(np.float64)
        flat = head.identity.components.astype(np.float64) * np.sqrt(weights)[:, None]
        gram = flat.reshape(len(flat), -1) @ flat.reshape(len(flat), -1).T
        strength = np.diag(gram)
        assert (np.diff(strength) < 0.01 * strength[:-1]).all()
        correlation = gram / np.sqrt(np.outer(strength, strength))
        assert_allclose(correlation, np.eye(len(gram)), atol=0.01)

    def test_random_heads_differ_from_the_mean_as_people_do(
        self, head: GenericHead, rng: np.random.Generator
    ) -> None:
        face = head.regions["face"] > 0.5
        moves = [
            np.linalg.norm(head.identity.offsets(rng.normal(size=60))[face], axis=1).mean()
            for _ in range(20)
        ]
        assert 3 < np.mean(moves) < 8

    def test_offsets_take_fewer_coefficients(self, head: GenericHead) -> None:
        assert_allclose(head.identity.offsets(np.array([2.0])), 2 * head.identity.components[0])
        assert_array_equal(head.identity.offsets(np.zeros(0)), 0)

    def test_too_many_coefficients_are_refused(self, head: GenericHead) -> None:
        with pytest.raises(InputError, match=r"coefficients: expected at most 60 numbers, got 61"):
            head.identity.offsets(np.zeros(61))


class TestRegions:
    def test_lie_between_0_and_1_and_are_zero_off_the_skin(self, head: GenericHead) -> None:
        beyond = np.setdiff1d(np.arange(len(head.mesh.vertices)), head.mesh.vertices_of("skin"))
        for mask in head.regions.values():
            assert mask.dtype == np.float32
            assert mask.shape == (len(head.mesh.vertices),)
            assert 0 <= mask.min() < mask.max() <= 1
            assert_array_equal(mask[beyond], 0)

    def test_the_coarse_regions_share_out_the_skin(self, head: GenericHead) -> None:
        names = ("face", "neck", "scalp", "left_ear", "right_ear", "mouth_cavity", "eye_socket")
        total = np.sum([head.regions[name] for name in names], axis=0)
        assert_allclose(total[head.mesh.vertices_of("skin")], 1, atol=1e-5)

    @pytest.mark.parametrize(
        ("whole", "pieces"),
        [("face", ("forehead", "eyes", "mouth")), ("eyes", ("left_eye", "right_eye"))],
    )
    def test_pieces_make_up_the_whole(
        self, head: GenericHead, whole: str, pieces: tuple[str, ...]
    ) -> None:
        assert_allclose(
            sum(head.regions[piece] for piece in pieces), head.regions[whole], atol=1e-5
        )

    @pytest.mark.parametrize(
        ("feature", "region"),
        [
            ("nose_tip", "nose"),
            ("chin", "mouth"),
            ("left_eye_outer", "left_eye"),
            ("right_eye_outer", "right_eye"),
            ("left_ear.3", "left_ear"),
            ("upper_lip_outer.4", "lips"),
            ("left_eyebrow_upper.1", "forehead"),
        ],
    )
    def test_features_lie_in_their_regions(
        self, head: GenericHead, feature: str, region: str
    ) -> None:
        assert head.regions[region][head.vertex_of(feature)] > 0.5


class TestFeatures:
    def test_names_and_counts_are_as_agreed(self, head: GenericHead) -> None:
        lengths = {name: len(line) for name, line in head.polylines.items()}
        paired = {f"{s}_{n}": k for n, k in POLYLINE_LENGTHS.items() for s in ("left", "right")}
        assert lengths == paired | SINGLE_LENGTHS
        assert set(head.points) == POINTS
        assert len(POINTS) == 13

    def test_lie_on_the_skin_and_curves_visit_each_vertex_once(self, head: GenericHead) -> None:
        skin = set(head.mesh.vertices_of("skin").tolist())
        assert set(head.points.values()) <= skin
        for line in head.polylines.values():
            assert set(line) <= skin
            assert len(set(line)) == len(line)

    @pytest.mark.parametrize(
        ("point", "ends"),
        [
            ("left_eye_inner", ("left_upper_eyelid.0", "left_lower_eyelid.0")),
            ("left_eye_outer", ("left_upper_eyelid.6", "left_lower_eyelid.6")),
            ("left_mouth_corner", ("upper_lip_outer.8", "lower_lip_outer.8", "upper_lip_inner.6")),
            ("right_mouth_corner", ("upper_lip_outer.0", "lower_lip_inner.0")),
            ("nose_root", ("nose_ridge.0",)),
            ("nose_tip", ("nose_ridge.4",)),
            ("left_ear_lobe", ("left_jaw.6", "left_ear.6")),
            ("right_ear_lobe", ("right_jaw.6", "right_ear.6")),
        ],
    )
    def test_curves_end_at_their_points(
        self, head: GenericHead, point: str, ends: tuple[str, ...]
    ) -> None:
        assert {head.vertex_of(end) for end in ends} == {head.points[point]}

    def test_directions(self, head: GenericHead) -> None:
        """Paired curves run outwards, single ones to the subject's left, upright ones down."""
        for name, line in head.polylines.items():
            first, last = head.mesh.vertices[[line[0], line[-1]]]
            if name == "nose_ridge" or name.endswith("_ear"):
                assert first[1] > last[1]
            elif name in SINGLE_LENGTHS:
                assert first[0] < last[0]
            else:
                assert abs(first[0]) < abs(last[0])

    def test_steps_along_a_curve_are_alike(self, head: GenericHead) -> None:
        for name, line in head.polylines.items():
            steps = np.linalg.norm(np.diff(head.mesh.vertices[list(line)], axis=0), axis=1)
            assert steps.max() < 2.3 * steps.min(), name

    def test_the_upper_lip_lies_above_the_lower(self, head: GenericHead) -> None:
        names = ("upper_lip_outer.4", "upper_lip_inner.3", "lower_lip_inner.3", "lower_lip_outer.4")
        heights = [head.mesh.vertices[head.vertex_of(name), 1] for name in names]
        assert heights == sorted(heights, reverse=True)

    def test_names_lead_to_vertices(self, head: GenericHead) -> None:
        assert head.vertex_of("chin") == head.points["chin"]
        assert head.vertex_of("left_jaw.3") == head.polylines["left_jaw"][3]
        assert len(set(head.feature_names)) == 13 + sum(map(len, head.polylines.values()))
        for name in head.feature_names:
            head.vertex_of(name)

    @pytest.mark.parametrize("name", ["left_jaw.7", "left_jaw", "left_jaw.-1", "left_jaw.x"])
    def test_an_unknown_name_is_answered_with_close_ones(
        self, head: GenericHead, name: str
    ) -> None:
        with pytest.raises(InputError, match=r"feature: expected .* such as .*left_jaw\.\d.*, got"):
            head.vertex_of(name)

    def test_a_name_like_no_other_is_refused(self, head: GenericHead) -> None:
        with pytest.raises(InputError, match="expected a feature's name, got 42"):
            head.vertex_of("42")


class TestLandmarks:
    def test_nearly_all_are_attached(self, head: GenericHead) -> None:
        assert head.landmark_attached.sum() > 450
        assert_allclose(head.landmark_barycentrics.sum(1), 1, atol=1e-6)
        assert head.landmark_barycentrics.min() > -1e-6

    def test_mirror_each_other(self, head: GenericHead) -> None:
        positions = head.landmark_positions(head.mesh.vertices)[head.landmark_attached]
        gaps = np.linalg.norm((positions * FLIP)[:, None] - positions[None], axis=2)
        assert gaps.min(1).max() < 0.2

    def test_irises_lie_on_the_eyeballs_and_the_rest_on_outer_skin(self, head: GenericHead) -> None:
        part = head.mesh.part[head.landmark_triangles]
        assert_array_equal(part[468:473], PARTS.index("right_eyeball"))
        assert_array_equal(part[473:478], PARTS.index("left_eyeball"))
        assert_array_equal(part[:468], PARTS.index("skin"))
        corners = head.mesh.triangles[head.landmark_triangles[:468]]
        for hidden in ("mouth_cavity", "eye_socket"):
            assert_array_equal(head.regions[hidden][corners], 0)
        positions = head.landmark_positions(head.mesh.vertices)
        assert positions[:, 2].min() > -90

    @pytest.mark.parametrize(
        ("landmark", "feature", "within_mm"),
        [
            (33, "right_eye_outer", 2),
            (133, "right_eye_inner", 3),
            (362, "left_eye_inner", 3),
            (263, "left_eye_outer", 2),
            (61, "right_mouth_corner", 3),
            (291, "left_mouth_corner", 3),
            (1, "nose_tip", 6),
            (0, "upper_lip_outer.4", 3),
            (17, "lower_lip_outer.4", 4),
            (152, "left_jaw.0", 8),
            (159, "right_upper_eyelid.3", 3),
            (374, "left_lower_eyelid.3", 2),
        ],
    )
    def test_agree_with_the_features(
        self, head: GenericHead, landmark: int, feature: str, within_mm: float
    ) -> None:
        place = head.landmark_positions(head.mesh.vertices)[landmark]
        assert np.linalg.norm(place - head.mesh.vertices[head.vertex_of(feature)]) < within_mm

    def test_follow_the_vertices(self, head: GenericHead) -> None:
        moved = head.landmark_positions(head.mesh.vertices + np.array([1.0, 2.0, 3.0]))
        assert_allclose(moved - head.landmark_positions(head.mesh.vertices), [[1, 2, 3]] * 478)

    def test_refuse_vertices_of_another_head(self, head: GenericHead) -> None:
        with pytest.raises(InputError, match=r"vertices: expected shape"):
            head.landmark_positions(np.zeros((7, 3)))


class TestLoading:
    def test_is_cached_and_read_only(self, head: GenericHead) -> None:
        assert load_generic_head() is head
        for array in (head.mirror, head.unit_offsets, head.identity.components):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1

    def test_a_missing_file_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(generic, "files", lambda _: "nowhere")
        with pytest.raises(FileFormatError, match=r"nowhere/data/generic_head\.npz: .*reinstall"):
            load_generic_head.__wrapped__()

    def test_twice_gives_the_same(self, head: GenericHead) -> None:
        again = load_generic_head.__wrapped__()
        assert_array_equal(again.mesh.vertices, head.mesh.vertices)
        assert_array_equal(again.unit_offsets, head.unit_offsets)

    @pytest.mark.parametrize("name", ["generic_head", "face_landmarker", "selfie_segmentation"])
    def test_licences_lie_beside_the_files(self, name: str) -> None:
        text = (files("mien.assets") / "data" / f"{name}.LICENSE.txt").read_text(encoding="utf-8")
        assert ("CC0" if name == "generic_head" else "Apache License") in text

    @pytest.mark.parametrize(
        ("name", "digest"),
        [
            ("face_landmarker.task", "64184e229b263107bc2b804c6625db1341ff2bb7"),
            ("selfie_segmentation.tflite", "9ee168ec7c8f2a16c56fe8e1cfbc514974cbbb7e"),
        ],
    )
    def test_the_models_are_the_published_ones(self, name: str, digest: str) -> None:
        data = (files("mien.assets") / "data" / name).read_bytes()
        assert hashlib.sha256(data).hexdigest().startswith(digest)
