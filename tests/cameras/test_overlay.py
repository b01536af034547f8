from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import burg_drake as burg
from burg_drake.cameras import (
    INNER_KIND,
    OUTLINE_KIND,
    VERDICT_COLORS,
    CheckedImage,
    CheckedScene,
    FieldOfView,
    Intrinsics,
    Overlay,
    OverlayStyle,
    Placement,
    PlacementCheck,
    SceneMesh,
    SurfaceCamera,
    VisibleLines,
    build_scene_mesh,
    correction_mark,
    draw_notice,
    find_tag_corners,
    instance_labels,
    rasterize_lines,
    visible_lines,
)
from burg_drake.core import Array, InvalidInputError, Pose, UnknownNameError, make_pose
from burg_drake.scene import Scene

LENS = (-0.25, 0.08, 0.0004, -0.0003, 0.0)
PINHOLE = Intrinsics(width=320, height=240, focal=(300.0, 302.0), center=(160.3, 118.9))
WIDE = Intrinsics(
    width=320, height=240, focal=(230.0, 231.0), center=(158.0, 121.0), distortion=LENS
)
PLAIN = OverlayStyle(names=False, footprints=False)


def looking(eye: tuple[float, ...], target: tuple[float, ...] = (0.3, 0.2, 0.03)) -> Array:
    """X_SC of a camera that stands upright."""
    z = np.array(target) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    return make_pose(np.stack([x, np.cross(z, x), z], axis=1), eye)


VIEWS = [looking((0.3, -0.35, 0.45)), looking((-0.15, 0.0, 0.2)), looking((0.6, 0.7, 0.5))]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return burg.load_scene("tabletop_six")


@pytest.fixture(scope="module")
def shape(scene: Scene) -> SceneMesh:
    return build_scene_mesh(scene)


def gray(intrinsics: Intrinsics = PINHOLE) -> NDArray[np.uint8]:
    return np.full((intrinsics.height, intrinsics.width, 3), 128, np.uint8)


def labels_at(shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array, pixels: Array) -> Array:
    """Which instance points of the image show: a ray each, and nothing else."""
    flat = (intrinsics.undistort(pixels) - intrinsics.center) / intrinsics.focal
    rays = np.column_stack([flat, np.ones(len(flat))]) @ X_SC[:3, :3].T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    face, _ = shape.rays.first_hits(np.broadcast_to(X_SC[:3, 3], rays.shape), rays)
    return np.where(face < 0, -1, shape.owner[face])


def all_labels(shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array) -> Array:
    size = intrinsics.width, intrinsics.height
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in size]), axis=-1).reshape(-1, 2)
    return labels_at(shape, intrinsics, X_SC, grid.astype(float)).reshape(size[::-1])


def borders(shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array) -> Array:
    """(N, 2) points where neighbouring pixels' labels change, found by halving with rays."""
    labels, found = all_labels(shape, intrinsics, X_SC), []
    for axis, step in ((0, (0, 1)), (1, (1, 0))):
        low = np.argwhere(np.diff(labels, axis=axis) != 0)[:, ::-1].astype(float)
        high = low + np.array(step)
        first = labels_at(shape, intrinsics, X_SC, low)
        for _ in range(10):
            middle = (low + high) / 2
            same = (labels_at(shape, intrinsics, X_SC, middle) == first)[:, None]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        found.append((low + high) / 2)
    return np.concatenate(found)


def distances(points: Array, ends: Array) -> Array:
    a, e = ends[None, :, 0], (ends[:, 1] - ends[:, 0])[None]
    along = ((points[:, None] - a) * e).sum(axis=2) / np.maximum((e**2).sum(axis=2), 1e-12)
    nearest = a + np.clip(along, 0.0, 1.0)[..., None] * e
    return np.asarray(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1))


@pytest.mark.parametrize("intrinsics", [PINHOLE, WIDE], ids=["pinhole", "lens"])
@pytest.mark.parametrize("X_SC", VIEWS)
def test_outlines_are_where_rays_find_borders(
    shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array
) -> None:
    lines = visible_lines(shape, FieldOfView(intrinsics), X_SC)
    truth = borders(shape, intrinsics, X_SC)
    error = distances(truth, lines.ends[lines.kind == OUTLINE_KIND])
    # The ends of bits that run behind another object are seen or hidden as a whole.
    assert len(truth) > 500 and np.percentile(error, 99) < 0.02 and (error < 0.1).mean() > 0.995


@pytest.mark.parametrize("X_SC", VIEWS)
def test_every_outline_is_a_border(shape: SceneMesh, X_SC: Array) -> None:
    lines = visible_lines(shape, FieldOfView(PINHOLE), X_SC)
    ends = lines.ends[lines.kind == OUTLINE_KIND]
    along = ends[:, 1] - ends[:, 0]
    long = np.linalg.norm(along, axis=1) > 0.2
    ends, along = ends[long], along[long]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sides = [labels_at(shape, PINHOLE, X_SC, ends.mean(axis=1) + s * normal) for s in (-0.15, 0.15)]
    assert (sides[0] != sides[1]).mean() > 0.99


@pytest.mark.parametrize("intrinsics", [PINHOLE, WIDE], ids=["pinhole", "lens"])
@pytest.mark.parametrize("X_SC", VIEWS)
def test_labels_are_those_of_a_ray_a_pixel(
    scene: Scene, shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array
) -> None:
    labels = instance_labels(scene, intrinsics, X_SC)
    np.testing.assert_array_equal(labels, all_labels(shape, intrinsics, X_SC))


def test_outline_of_a_ball_is_the_ellipse_of_its_cone() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    center = np.array([0.06, -0.04, 0.5])
    shape = SceneMesh({"ball": (ball.vertices + center, np.array(ball.faces))})
    lines = visible_lines(shape, FieldOfView(PINHOLE), np.eye(4))
    flat = (lines.ends.reshape(-1, 2) - PINHOLE.center) / PINHOLE.focal
    rays = np.column_stack([flat, np.ones(len(flat))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    passing = np.linalg.norm(np.cross(rays, center), axis=1)  # distance from the ball's centre
    error = (0.05 - passing) / 0.5 * 300.0
    assert (lines.kind == OUTLINE_KIND).all() and np.abs(error).max() < 0.05


def test_nearer_objects_hide_others_even_where_they_interlock() -> None:
    # A bar through a ring: seen from the side, the near half of the ring hides the bar, and the bar
    # hides the far half.
    ring = trimesh.creation.torus(0.05, 0.01)
    bar = trimesh.creation.box((0.01, 0.01, 0.3))
    shape = SceneMesh(
        {n: (np.array(m.vertices), np.array(m.faces)) for n, m in (("ring", ring), ("bar", bar))}
    )
    X_SC = looking((0.0, -0.5, 0.25), (0.0, 0.0, 0.0))
    view = FieldOfView(PINHOLE)
    lines = visible_lines(shape, view, X_SC)
    shades = np.full(len(shape.owner), 200, np.uint8)
    owner = SurfaceCamera(shape, view).render(X_SC, lines, shades).owner
    p = np.array([[0.0, -0.05, 0.01], [0.0, 0.05, 0.0], [0.0, -0.005, 0.1], [0.0, 0.0, 0.0]])
    x, y = np.round(PINHOLE.project((p - X_SC[:3, 3]) @ X_SC[:3, :3])).astype(int).T
    assert owner[y, x].tolist() == [0, 1, 1, 1]
    np.testing.assert_array_equal(owner, all_labels(shape, PINHOLE, X_SC))


def test_a_handle_before_its_mug_is_an_inner_line(scene: Scene, shape: SceneMesh) -> None:
    mug = shape.select(("mug",))
    yaw = np.deg2rad(140.0)  # where the handle points
    middle = mug.boxes[0].mean(axis=0)
    eye = middle + 0.35 * np.array([np.cos(yaw), np.sin(yaw), 0.5])
    lines = visible_lines(mug, FieldOfView(PINHOLE), looking(tuple(eye), tuple(middle)))
    assert (lines.kind == INNER_KIND).sum() > 20


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.785, 1.2, 1.57])
def test_strokes_lie_where_they_should(angle: float) -> None:
    along, across = (np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))
    start = np.array([50.37, 40.81])
    points = start + np.arange(-30, 31, 1.7)[:, None] * np.array(along)
    ends = np.stack([points[:-1], points[1:]], axis=1)
    drawn = rasterize_lines(ends, np.full(len(ends), 1.1), 1.5, (100, 80))
    at = np.stack([drawn.at % 100, drawn.at // 100], axis=1) - start
    middle = np.abs(at @ along) < 15.0
    cover = drawn.cover()[middle]
    # Shares of pixels have their middle within 1 / (8 width) of the line's, where it runs along
    # rows or columns.
    offset = abs((cover * (at[middle] @ across)).sum() / cover.sum())
    assert offset < (1.0 / (8 * 2.2) if angle in (0.0, 1.57) else 0.02)
    assert cover.sum() == pytest.approx(2 * 15.0 * 2.2, rel=0.04)  # to a row of pixels


def test_overlapping_bits_cover_no_more_than_one() -> None:
    one = np.array([[[10.2, 10.0], [14.0, 12.5]]])
    twice = rasterize_lines(np.concatenate([one, one]), np.ones(2), 1.5, (30, 30))
    once = rasterize_lines(one, np.ones(1), 1.5, (30, 30))
    np.testing.assert_array_equal(twice.at, once.at)
    np.testing.assert_allclose(twice.cover(), once.cover(), atol=2e-3)


def test_draws_over_the_objects_alone(scene: Scene, shape: SceneMesh) -> None:
    image = gray()
    drawn = Overlay(scene, PINHOLE, PLAIN).draw(image, VIEWS[0])
    assert (image == 128).all() and drawn.dtype == np.uint8
    changed = (drawn != 128).any(axis=2)
    labels = all_labels(shape, PINHOLE, VIEWS[0])
    ends = visible_lines(shape, FieldOfView(PINHOLE), VIEWS[0]).ends
    near = np.zeros_like(changed)
    for shift in np.stack(np.meshgrid(*[np.arange(-5, 6)] * 2), axis=-1).reshape(-1, 2):
        x, y = np.clip(np.round(ends.mean(axis=1) + shift), 0, (319, 239)).astype(int).T
        near[y, x] = True
    assert changed[labels >= 0].all() and not changed[(labels < 0) & ~near].any()


def test_outlines_alone_leave_surfaces_as_they_are(scene: Scene, shape: SceneMesh) -> None:
    overlay = Overlay(scene, PINHOLE)
    style = OverlayStyle(opacity=0.0, names=False, footprints=False)
    whole = overlay.draw(gray(), VIEWS[0], style=PLAIN)
    drawn = overlay.draw(gray(), VIEWS[0], style=style)
    inside = all_labels(shape, PINHOLE, VIEWS[0]) >= 0
    assert 0.1 < (drawn[inside] != 128).any(axis=1).mean() < 0.75
    np.testing.assert_array_equal(drawn[~inside], whole[~inside])


def test_shown_instances_hide_and_are_hidden_by_no_others(scene: Scene) -> None:
    overlay = Overlay(scene, PINHOLE, PLAIN)
    X_SC = looking((0.3, -0.3, 0.1))
    both = overlay.draw(gray(), X_SC)
    bowl = overlay.draw(gray(), X_SC, style=OverlayStyle(shown=("bowl",), names=False))
    x, y = np.round(PINHOLE.project((np.array([0.29, 0.25, 0.04]) - X_SC[:3, 3]) @ X_SC[:3, :3]))
    at = int(y), int(x)
    assert (bowl[at] != 128).any() and (bowl[at] != both[at]).any()  # the bottle stands before it
    nothing = overlay.draw(gray(), X_SC, style=OverlayStyle(shown=()))
    assert (nothing == 128).all()
    with pytest.raises(UnknownNameError, match=r"instance 'bowle' does not exist; .*bowl"):
        overlay.draw(gray(), X_SC, style=OverlayStyle(shown=("bowle",)))


def test_colors_stay_when_others_are_not_shown(scene: Scene) -> None:
    overlay = Overlay(scene, PINHOLE, PLAIN)
    X_SC = looking((0.5, 0.3, 0.6), (0.5, 0.29, 0.0))
    alone = OverlayStyle(shown=("banana",), names=False, footprints=False)
    first, second = overlay.draw(gray(), X_SC), overlay.draw(gray(), X_SC, style=alone)
    window = np.s_[90:150, 130:190]
    np.testing.assert_array_equal(first[window], second[window])
    assert (first[window] != 128).any()


def test_a_camera_that_sees_nothing_changes_nothing(scene: Scene) -> None:
    away = looking((0.3, 0.2, 0.5), (0.3, 0.3, 2.0))
    assert (Overlay(scene, PINHOLE).draw(gray(), away) == 128).all()
    assert (Overlay(scene, WIDE).draw(gray(WIDE), away) == 128).all()


def test_an_empty_scene_changes_nothing(scene: Scene) -> None:
    empty = replace(scene, document=replace(scene.document, instances=()))
    assert (Overlay(empty, PINHOLE).draw(gray(), VIEWS[0]) == 128).all()
    assert (instance_labels(empty, PINHOLE, VIEWS[0]) == -1).all()


@pytest.mark.parametrize("intrinsics", [PINHOLE, WIDE], ids=["pinhole", "lens"])
def test_near_and_inside_an_object(scene: Scene, shape: SceneMesh, intrinsics: Intrinsics) -> None:
    overlay = Overlay(scene, intrinsics)
    box = shape.boxes[shape.names.index("box")]
    inside = box.mean(axis=0)
    beside = inside - (0.0, 0.09, 0.0)
    for eye in (inside, beside):
        X_SC = looking(tuple(eye), (eye[0] + 0.01, eye[1] + 0.3, eye[2] - 0.05))
        drawn = overlay.draw(gray(intrinsics), X_SC)
        assert (drawn != 128).any()
        np.testing.assert_array_equal(
            instance_labels(scene, intrinsics, X_SC), all_labels(shape, intrinsics, X_SC)
        )


def test_lines_bend_with_the_lens() -> None:
    # A square sheet that fills the image: its rim is drawn where its points are.
    side = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float) * (0.55, 0.42, 1.0)
    shape = SceneMesh({"sheet": (side, np.array([[0, 1, 2], [0, 2, 3]]))})
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 1.0))
    lines: VisibleLines = visible_lines(shape, FieldOfView(WIDE), X_SC)
    rim = np.linspace(side[0], side[1], 50)
    truth = WIDE.project((rim - X_SC[:3, 3]) @ X_SC[:3, :3])
    inside = ((truth > 0) & (truth < (319, 239))).all(axis=1)
    assert inside.sum() > 20 and distances(truth[inside], lines.ends).max() < 0.02
    straight = truth[inside][0] + np.linspace(0, 1, 9)[:, None] * np.ptp(truth[inside], axis=0)
    assert distances(straight[4:5], lines.ends).max() > 0.5  # which a straight line is not


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((480, 640, 3), np.uint8), "image has 640 x 480 pixels.* 320 x 240"),
        (np.zeros((240, 320), np.uint8), r"\(H, W, 3\) uint8"),
        (np.zeros((240, 320, 3)), r"float64.*\(H, W, 3\) uint8"),
    ],
)
def test_refuses_other_images(scene: Scene, image: Array, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Overlay(scene, PINHOLE).draw(image, VIEWS[0])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"opacity": 1.5}, "opacity 1.5"),
        ({"outline_width": -1.0}, "outline_width -1"),
        ({"tolerance": -1e-3}, "tolerances"),
    ],
)
def test_refuses_other_styles(values: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        OverlayStyle(**values)  # type: ignore[arg-type]


def placed(displacement: tuple[float, float] | None, angle: float | None) -> Placement:
    status = "measured" if displacement else "not_seen"
    return Placement(
        object="box",
        status=status,  # type: ignore[arg-type]
        target=Pose((0.3, 0.2, 0.0), rpy_deg=(0.0, 0.0, 90.0)),
        reference=(0.1, 0.0, 0.0),
        displacement=displacement,
        angle=angle,
    )


def test_arrows_lead_from_where_it_stands_to_where_it_should() -> None:
    note = correction_mark(placed((0.03, -0.04), None), OverlayStyle(), 0.1)
    np.testing.assert_allclose(note.lines[0], [[0.33, 0.26, 0.1], [0.3, 0.3, 0.1]], atol=1e-12)
    assert note.verdict == "off" and note.text == "50 mm"
    short = correction_mark(placed((0.0, 0.002), 0.001), OverlayStyle(), 0.1)
    start, tip = short.lines[0]
    np.testing.assert_allclose(tip, [0.3, 0.3, 0.1], atol=1e-12)
    assert start[1] > tip[1] + 0.02 and short.text == "2.0 mm 0.1°"


@pytest.mark.parametrize("angle", [0.4, -0.4])
def test_arcs_turn_back(angle: float) -> None:
    note = correction_mark(placed((0.0, 0.0), angle), OverlayStyle(), 0.0)
    spokes = note.lines[:-2, :, :2] - (0.3, 0.3)
    turning = np.cross(
        np.pad(spokes[:, 0], ((0, 0), (0, 1))), np.pad(spokes[:, 1], ((0, 0), (0, 1)))
    )
    assert (np.sign(turning[:, 2]) == -np.sign(angle)).all()


def test_verdicts() -> None:
    style = OverlayStyle(tolerance=1e-3, angle_tolerance=math.radians(1.0))
    good = correction_mark(placed((6e-4, -7e-4), math.radians(-0.9)), style, 0.0)
    assert good.verdict == "placed" and good.text == "0.9 mm 0.9°" and not len(good.lines)
    assert correction_mark(placed((1.1e-3, 0.0), None), style, 0.0).verdict == "off"
    assert correction_mark(placed((0.0, 0.0), math.radians(1.1)), style, 0.0).verdict == "off"
    assert correction_mark(placed(None, None), style, 0.0).verdict == "not_seen"


def test_doubtful_results_have_a_question_mark_and_their_spread() -> None:
    sure = replace(
        placed((3e-3, 4e-3), math.radians(12.0)),
        displacement_sd=(6e-4, 8e-4),
        angle_sd=math.radians(2.0),
    )
    doubtful = replace(sure, status="uncertain", reason="two poses fit equally well")
    assert correction_mark(sure, OverlayStyle(), 0.0).text == "5.0 mm 12°"
    note = correction_mark(doubtful, OverlayStyle(), 0.0)
    assert (note.verdict, note.text) == ("uncertain", "? 5.0±1.0 mm 12±2.0°")
    nowhere = replace(placed(None, None), status="uncertain", reason="no outline")
    assert correction_mark(nowhere, OverlayStyle(), 0.0).verdict == "uncertain"


def test_placement_shows_in_the_colour_of_outlines(scene: Scene) -> None:
    overlay = Overlay(scene, PINHOLE, PLAIN)
    check = PlacementCheck(
        scene=CheckedScene(name="tabletop_six", content=scene.content),
        method="silhouette",
        image=CheckedImage(content=""),
        intrinsics=PINHOLE,
        instances={"bowl": placed((2e-4, 0.0), None), "mug": placed((0.02, 0.0), None)},
    )
    drawn = overlay.draw(gray(), VIEWS[0], placement=check)
    for verdict in ("placed", "off"):
        assert (drawn == VERDICT_COLORS[verdict]).all(axis=2).sum() > 30
    doubtful = replace(check.instances["mug"], status="uncertain", reason="badly fitting outline")
    dashed = overlay.draw(gray(), VIEWS[0], placement=replace(check, instances={"mug": doubtful}))
    arrows = replace(check, instances={"mug": replace(doubtful, displacement=(2e-4, 0.0))})
    bare = overlay.draw(gray(), VIEWS[0], placement=arrows)
    assert (dashed == VERDICT_COLORS["uncertain"]).all(axis=2).sum() > 30
    whole = replace(check, instances={"mug": placed((2e-4, 0.0), None)})
    green = (overlay.draw(gray(), VIEWS[0], placement=whole) == VERDICT_COLORS["placed"]).all(
        axis=2
    )
    yellow = (bare == VERDICT_COLORS["uncertain"]).all(axis=2)
    assert 0.4 * green.sum() < yellow.sum() < 0.75 * green.sum() and not (yellow & ~green).any()
    quiet = OverlayStyle(errors=False, names=False, footprints=False)
    np.testing.assert_array_equal(
        overlay.draw(gray(), VIEWS[0], placement=check, style=quiet),
        overlay.draw(gray(), VIEWS[0]),
    )


def test_tags_lie_beside_each_other() -> None:
    rng = np.random.default_rng(3)
    low = rng.uniform((0, 0), (560, 420), (7, 2))
    boxes = np.stack([low, low + rng.uniform(10, 60, (7, 2))], axis=1)
    sizes = [(int(w), 20) for w in rng.integers(40, 110, 7)]
    corners = find_tag_corners(boxes, sizes, np.zeros((480, 640), bool))
    taken = np.zeros((480, 640), int)
    for (x, y), (w, h) in zip(corners, sizes, strict=True):
        assert 0 <= x <= 640 - w and 0 <= y <= 480 - h
        taken[y : y + h, x : x + w] += 1
    assert taken.max() == 1


def test_tags_lie_on_no_body() -> None:
    """Bodies fill the image but for a strip on the right: the tag of the nearest goes there, and
    that of a bar at the upper edge, which has no room above, below it."""
    bodies = np.ones((480, 640), bool)
    bodies[:, 500:] = False
    (corner,) = find_tag_corners(np.array([[[400.0, 200.0], [495.0, 260.0]]]), [(80, 20)], bodies)
    assert corner[0] >= 499 and 180 <= corner[1] <= 270
    bar = np.zeros((480, 640), bool)
    bar[:30, 100:400] = True
    (corner,) = find_tag_corners(np.array([[[100.0, 0.0], [399.0, 29.0]]]), [(80, 20)], bar)
    assert not bar[corner[1] : corner[1] + 20, corner[0] : corner[0] + 80].any()


def test_notices_are_wrapped_and_change_a_copy() -> None:
    image = gray()
    short, long = draw_notice(image, "no marker"), draw_notice(image, "no marker of the board " * 5)
    rows = [(n != 128).any(axis=(1, 2)).sum() for n in (short, long)]
    assert (image == 128).all() and rows[0] < 40 < rows[1] < 140
