"""Images of a scene: against Drake's renderer, which shares no code with the rays, and formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.math import RigidTransform

import burg_drake as burg
from burg_drake.cameras import Intrinsics
from burg_drake.core import InvalidInputError, UnknownNameError, inverse, make_pose
from burg_drake.dataset import (
    RayScene,
    RaySurface,
    SceneRenderer,
    View,
    label_instances,
    render,
    station_view,
)
from burg_drake.scene import Scene
from burg_drake.station import Station, StationDiagram, build_station_diagram, render_cameras
from tests.thorough import thorough


@pytest.fixture(scope="module")
def scene() -> Scene:
    return burg.load_scene("tabletop_six")


@pytest.fixture(scope="module")
def station() -> Station:
    return burg.load_station("panda_tabletop")


@pytest.fixture(scope="module")
def renderer(scene: Scene, station: Station) -> SceneRenderer:
    return SceneRenderer(scene, station)


def drake_images(built: StationDiagram, camera: str) -> tuple[np.ndarray, np.ndarray]:
    """Depth and label images of Drake's own renderer."""
    document = built.station.camera(camera)
    color, depth = render_cameras(document)
    context = built.diagram.CreateDefaultContext()
    scene_graph = built.scene_graph
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    X_WC = RigidTransform(document.X_WC.matrix())
    world = scene_graph.world_frame_id()
    depths = np.array(query.RenderDepthImage(depth, world, X_WC).data[..., 0])
    labels = np.array(query.RenderLabelImage(color, world, X_WC).data[..., 0])
    return depths, labels


@pytest.mark.parametrize("camera", ["board", "overview"])
def test_as_drake_renders_it(scene: Scene, station: Station, camera: str) -> None:
    """All pixels but those that an edge runs through within a thousandth of a pixel."""
    built = build_station_diagram(scene, station, robot="none", cameras=[camera])
    depth, labels = drake_images(built, camera)
    images = render(scene, station, camera, ("depth", "labels"))
    assert images.labels is not None and images.depth is not None and images.color is None
    theirs = np.zeros_like(images.labels)
    for number, name in enumerate(scene.instances, 1):
        theirs[labels == int(built.free[name])] = number
    assert np.count_nonzero(theirs != images.labels) <= 2
    seen = np.isfinite(depth) & (images.depth > 0.0)
    assert np.count_nonzero(np.isfinite(depth) != (images.depth > 0.0)) <= 2
    apart = np.abs(depth - images.depth)[seen]
    assert np.count_nonzero(apart > 1e-5) <= 20
    assert np.unique(images.labels).tolist() == list(range(7))


def test_the_table_is_flat_to_a_hundredth_of_a_millimetre(scene: Scene, station: Station) -> None:
    images = render(scene, station, "board", ("depth", "labels"))
    camera = station.camera("board")
    rows, columns = np.nonzero((images.labels == 0) & (images.depth > 0.0))
    assert len(rows) > 100_000
    (fx, fy), (cx, cy) = camera.focal, camera.principal_point
    z = images.depth[rows, columns].astype(float)
    points = np.stack([(columns - cx) / fx * z, (rows - cy) / fy * z, z, np.ones_like(z)])
    height = (camera.X_WC.matrix() @ points)[2]
    # the sheet lies in the plane of the table's contact, the table is drawn 0.1 mm below it
    on_top = height > -0.01
    assert on_top.mean() > 0.99
    assert np.minimum(np.abs(height), np.abs(height + 1e-4))[on_top].max() < 1e-5


def pixels_and_box(mask: NDArray[np.bool_]) -> tuple[int, tuple[int, ...]]:
    """How many pixels are on, and left column, top row, width and height around them."""
    rows, columns = np.nonzero(mask)
    left, top = columns.min(), rows.min()
    return len(rows), (left, top, columns.max() - left + 1, rows.max() - top + 1)


def ball(radius: float, p_SB: tuple[float, float, float], label: int) -> RaySurface:
    import trimesh

    mesh = trimesh.creation.icosphere(5, radius)
    return RaySurface(label, np.asarray(mesh.vertices) + p_SB, np.asarray(mesh.faces))


def view_down(distance: float, **options: object) -> View:
    """A camera above the origin of S that looks down."""
    settings = {"width": 200, "height": 160, "focal": (180.0, 170.0), "center": (90.0, 80.0)}
    return View(
        camera="down",
        intrinsics=Intrinsics(**(settings | options)),
        X_SC=make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, distance)),
    )


def pixels_of_ball(view: View, p_CB: np.ndarray, radius: float, reach: int = 0) -> np.ndarray:
    """Whether the rays of pixels, some beyond the image, meet a ball: by formula."""
    one = view.intrinsics
    x = (np.arange(-reach, one.width + reach) - one.center[0]) / one.focal[0]
    y = (np.arange(-reach, one.height + reach) - one.center[1]) / one.focal[1]
    d = np.stack([*np.meshgrid(x, y), np.ones((len(y), len(x)))], axis=-1)
    along = d @ p_CB / np.linalg.norm(d, axis=-1)
    return (p_CB @ p_CB - along**2 < radius**2) & (along > 0.0)


def test_balls_by_formula() -> None:
    near, far = (0.02, 0.01, 0.1), (0.05, 0.02, 0.0)
    rays = RayScene([ball(0.03, near, 1), ball(0.05, far, 2)])
    view = view_down(0.6)
    images = rays.images(view, normals=True)
    X_CS = inverse(view.X_SC)
    masks = [
        pixels_of_ball(view, X_CS[:3, :3] @ p + X_CS[:3, 3], r)
        for p, r in ((near, 0.03), (far, 0.05))
    ]
    expected = np.where(masks[0], 1, np.where(masks[1], 2, 0))
    assert np.count_nonzero(expected != images.labels) <= 0.01 * np.count_nonzero(expected)
    silhouette = rays.silhouette(2, view).mask_in_image(200, 160)
    assert np.count_nonzero(silhouette != masks[1]) <= 0.01 * np.count_nonzero(masks[1])
    at = tuple(np.argwhere(images.labels == 1).mean(axis=0).astype(int))
    assert images.depth[at] == pytest.approx(0.6 - 0.13, abs=5e-4)
    short = rays.images(replace(view, depth_range=(0.1, 0.5)), normals=True)
    beyond = images.depth > 0.5
    assert beyond[images.labels == 2].all() and not beyond[images.labels == 1].all()
    assert np.array_equal(short.depth, np.where(beyond, 0.0, images.depth))
    assert np.array_equal(short.labels, images.labels)  # these stay where depth is cut
    assert np.array_equal(short.normals, images.normals)
    normal = images.normals[images.labels > 0]
    assert np.allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-5)
    assert (normal[:, 2] < 0.2).all() and images.normals[images.labels == 0].max() == 0.0


def test_a_silhouette_goes_on_beyond_the_image() -> None:
    place = (-0.25, 0.0, 0.0)
    rays = RayScene([ball(0.06, place, 1)])
    view = view_down(0.5)
    inside = rays.images(view).labels == 1
    silhouette = rays.silhouette(1, view)
    X_CS = inverse(view.X_SC)
    whole = pixels_of_ball(view, X_CS[:3, :3] @ place + X_CS[:3, 3], 0.06, reach=150)
    assert 0 < np.count_nonzero(inside) < 0.9 * np.count_nonzero(silhouette.mask)
    assert np.count_nonzero(silhouette.mask) == pytest.approx(np.count_nonzero(whole), rel=0.01)
    _, (left, top, width, height) = pixels_and_box(whole)
    assert silhouette.left == pytest.approx(left - 150, abs=1)
    assert silhouette.top == pytest.approx(top - 150, abs=1)
    assert silhouette.mask.shape == pytest.approx((height, width), abs=2)
    assert np.array_equal(silhouette.mask_in_image(200, 160), inside)
    behind = View(camera="up", intrinsics=view.intrinsics, X_SC=make_pose(p_AB=(0, 0, 0.5)))
    assert rays.silhouette(1, behind).mask.size == 0


def test_a_lens_moves_depth_and_labels_as_opencv_says(renderer: SceneRenderer) -> None:
    """Points of the surfaces, projected by OpenCV, have the depth of the pixel that they hit."""
    import cv2

    straight = station_view(renderer.station, "board")
    lens = Intrinsics(
        width=640, height=480, focal=(600.0, 600.0), center=(322.0, 236.0),
        distortion=(-0.28, 0.09, 0.001, -0.0005),
    )  # fmt: skip
    view = View(camera="lens", intrinsics=lens, X_SC=straight.X_SC)
    plain, bent = renderer.images(straight, ("depth", "labels")), renderer.images(view)
    rows, columns = np.nonzero(plain.labels == 5)
    z = plain.depth[rows, columns].astype(float)
    (fx, fy), (cx, cy) = straight.intrinsics.focal, straight.intrinsics.center
    points = np.stack([(columns - cx) / fx * z, (rows - cy) / fy * z, z], axis=-1)
    at, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), lens.K, lens.coefficients)
    column, row = np.round(at.reshape(-1, 2)).astype(int).T
    assert np.mean(bent.labels[row, column] == 5) > 0.97
    assert np.median(np.abs(bent.depth[row, column] - z)) < 1e-3
    yellow = bent.color[bent.labels == 6].astype(float).mean(axis=0)
    assert np.allclose(
        yellow, renderer.images(straight).color[plain.labels == 6].mean(axis=0), atol=4
    )


@pytest.mark.parametrize("camera", ["board", thorough("overview")])
def test_labels_of_instances(
    scene: Scene, station: Station, renderer: SceneRenderer, camera: str
) -> None:
    """Counted in Drake's label images of the whole scene and of each object alone. An edge may take
    or leave a pixel."""
    view = station_view(station, camera)
    images = renderer.images(view, ("depth", "labels"))
    found = {label.name: label for label in label_instances(renderer, view, images)}
    assert list(found) == list(scene.instances)
    built = build_station_diagram(scene, station, robot="none", cameras=[camera])
    _, labels = drake_images(built, camera)
    hidden = 0
    for number, (name, instance) in enumerate(scene.instances.items(), start=1):
        only = Scene(replace(scene.document, instances=(instance,)), scene.library, scene.path)
        alone = build_station_diagram(only, station, robot="none", cameras=[camera])
        whole = drake_images(alone, camera)[1] == int(alone.free[name])
        visible = labels == int(built.free[name])
        pixels, box = pixels_and_box(visible)
        all_pixels, amodal_box = pixels_and_box(whole)
        label = found[name]
        assert label.number == number
        assert label.visible_pixels == pytest.approx(pixels, abs=2)
        assert label.silhouette_pixels == pytest.approx(all_pixels, abs=2)
        assert label.visibility == pytest.approx(pixels / all_pixels, abs=4 / all_pixels)
        assert label.visible_box == box
        assert label.amodal_box == amodal_box
        assert np.count_nonzero(label.amodal != whole) <= 1
        assert np.allclose(view.X_SC @ label.X_CO, scene.X_SO(name), atol=1e-12)
        hidden += box != amodal_box
    assert hidden


def test_the_arm_stands_as_it_is_told(station: Station, scene: Scene) -> None:
    without = render(scene, station, "overview", ("depth",))
    home = station_view(station, "overview", arm=True)
    posture = (home.posture[0] + 0.5, *home.posture[1:])
    turned = View(camera="overview", intrinsics=home.intrinsics, X_SC=home.X_SC, posture=posture)
    renderer = SceneRenderer(scene, station, arm=True)
    first, second, again = (renderer.images(view).depth for view in (home, turned, home))
    assert np.array_equal(first, again) and not np.array_equal(first, second)
    assert np.count_nonzero(first != without.depth) > 5_000
    drawn = renderer.images(home).color.astype(int)
    moved = np.abs(drawn - renderer.images(turned).color).max(axis=2) > 60
    assert moved[(first != second)].mean() > 0.5
    bare = View(camera="overview", intrinsics=home.intrinsics, X_SC=home.X_SC)
    for one in (renderer, SceneRenderer(scene, station, arm=True, colors=False)):
        with pytest.raises(
            InvalidInputError, match=r"no joint positions, but the scene has an arm"
        ):
            one.images(bare, ("depth",))
    with pytest.raises(InvalidInputError, match=r"joint positions of 2 joints; the arm has 7"):
        renderer.images(
            View(camera="x", intrinsics=home.intrinsics, X_SC=home.X_SC, posture=(0.0, 1.0))
        )


def test_bad_requests(scene: Scene, station: Station) -> None:
    with pytest.raises(UnknownNameError, match=r"no camera 'bord'"):
        render(scene, station, "bord")
    with pytest.raises(InvalidInputError, match=r"image kind 'colour' does not exist"):
        render(scene, station, "board", ("colour",))  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match=r"depth range of a view is 2 to 1 m"):
        View(
            camera="x", intrinsics=view_down(1.0).intrinsics, X_SC=np.eye(4), depth_range=(2.0, 1.0)
        )
    fish = Intrinsics(
        width=640,
        height=480,
        focal=(60.0, 60.0),
        center=(320.0, 240.0),
        distortion=(0.001, 0, 0, 0),
    )
    wide = View(camera="fish", intrinsics=fish, X_SC=station_view(station, "board").X_SC)
    with pytest.raises(InvalidInputError, match=r"sees more than 76 degrees"):
        render(scene, station, wide, ("color",))


@pytest.mark.parametrize("distortion", [(), (-0.28, 0.09, 0.001, -0.0005)])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.3, 0.1, 0.2), (-0.2, 0.3, 0.6)])
def test_boxes_in_closed_form_are_as_their_triangles(
    distortion: tuple[float, ...], place: tuple[float, float, float]
) -> None:
    """From above, from aside, from among two boxes; the same box turned slightly has rays cast."""
    import trimesh

    eye = np.array(place) + np.array([0.0, 0.0, 0.9])
    flat = np.array([[-0.3, -0.2, 0.0], [0.3, -0.2, 0.0], [0.3, 0.2, 0.0], [-0.3, 0.2, 0.0]])
    block = trimesh.creation.box((0.2, 0.1, 0.3)).apply_translation((0.35, 0.1, 0.4))
    parts = [
        (flat, np.array([[0, 1, 2], [0, 2, 3]])),
        (np.asarray(block.vertices), np.asarray(block.faces)),
    ]
    z = np.array([0.1, 0.05, 0.0]) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, (0.0, 1.0, 0.0))
    x /= np.linalg.norm(x)
    X_SC = make_pose(np.column_stack([x, np.cross(z, x), z]), eye)
    settings = {"width": 200, "height": 160, "focal": (180.0, 170.0), "center": (90.0, 80.0)}
    view = View(camera="v", intrinsics=Intrinsics(**settings, distortion=distortion), X_SC=X_SC)
    boxes = [RaySurface(0, *part) for part in parts]
    assert all(one.box is not None for one in boxes)
    meshes = [RaySurface(k, *part) for k, part in enumerate(parts, 1)]
    closed = RayScene(boxes).images(view, normals=True)
    cast = RayScene(meshes).images(view, normals=True)
    met = closed.depth > 0.0
    assert met.mean() > 0.1
    assert np.count_nonzero(met != (cast.depth > 0.0)) <= 3
    both = met & (cast.depth > 0.0)
    assert np.count_nonzero(np.abs(closed.depth - cast.depth)[both] > 1e-6) <= 3
    apart = np.abs(closed.normals - cast.normals).max(axis=2)
    assert np.count_nonzero(apart[both] > 1e-6) <= 3 and not closed.normals[~met].any()


def test_what_is_no_box_is_not_taken_for_one() -> None:
    import trimesh

    box = trimesh.creation.box((0.2, 0.1, 0.3))
    open_box = np.asarray(box.vertices), np.asarray(box.faces)[2:]
    ell = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]], float)
    for vertices, faces in (
        open_box,
        (ell, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])),
        (np.asarray(trimesh.creation.icosphere().vertices), trimesh.creation.icosphere().faces),
    ):
        assert RaySurface(0, vertices, np.asarray(faces)).box is None
