"""What Blender makes of a scene: against rays and formulas, where there is one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

import burg_drake as burg
from burg_drake.cameras import Intrinsics
from burg_drake.core import MissingDependencyError, make_pose
from burg_drake.dataset import (
    BLENDER_ENVIRONMENT_VARIABLE,
    NO_APPEARANCE_COLOR,
    Blender,
    BlenderScene,
    Material,
    RayScene,
    RaySurface,
    SceneRenderer,
    View,
    blender_command,
    station_view,
)
from tests.dataset.blender_parts import DOWN, WHITE_CHALK, image_of, lamp, surface
from tests.dataset.shapes_scene import looking_at


@pytest.fixture(scope="module")
def rendering() -> Iterator[Blender]:
    try:
        process = Blender(blender_command())
    except MissingDependencyError as error:
        pytest.skip(str(error))
    yield process
    process.close()


def test_pixels_are_where_rays_have_them(rendering: Blender) -> None:
    """Shares of pixels that things take, each alone: their middles, and their edges. Those of a
    camera that is half a pixel aside would be, and of one with another focal length or axis."""
    ball = trimesh.creation.icosphere(4, 0.05)
    ball.apply_translation((0.06, -0.02, 0.05))
    box = trimesh.creation.box((0.06, 0.04, 0.05))
    box.apply_transform(trimesh.transformations.rotation_matrix(0.4, (0.2, 0.3, 1.0)))
    box.apply_translation((-0.07, 0.05, 0.03))
    camera = Intrinsics(width=480, height=360, focal=(840.0, 680.0), center=(190.3, 206.8))
    X_WC = looking_at((0.1, -0.25, 0.5), (0.0, 0.0, 0.03))
    view = View(camera="tilted", intrinsics=camera, X_SC=X_WC)
    for mesh in (ball, box):
        part = surface(mesh, Material())
        share = image_of(rendering, BlenderScene((part,), (), samples=32), X_WC, camera)[..., 3]
        labels = RayScene([RaySurface(1, part.vertices, part.faces)]).images(view).labels
        assert labels is not None
        mask = labels == 1
        inner = cv2.erode(labels, np.ones((3, 3))) == 1
        beyond = cv2.dilate(labels, np.ones((3, 3))) == 0
        assert mask.sum() > 5000 and (share[inner] == 255).all() and not share[beyond].any()
        assert np.count_nonzero((share > 127) != mask) < 0.005 * mask.sum()
        rows, columns = np.mgrid[:360, :480]
        for along in (rows, columns):
            middle = (share * along).sum() / share.sum(dtype=float)
            assert middle == pytest.approx(along[mask].mean(), abs=0.03)


def test_a_program_that_calls_itself_blender(
    rendering: Blender, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It is told to run the worker as Blender is, and may greet before."""
    stand_in = tmp_path / "blender"
    run = " ".join(blender_command()[:-1])
    stand_in.write_text(
        "#!/bin/sh\necho 'Blender 4.5.0'\n[ $1 = --version ] && exit\n"
        f'[ "$1 $2" = "--background --factory-startup" ] || exit 9\nexec {run} "$6"\n'
    )
    stand_in.chmod(0o755)
    monkeypatch.setenv(BLENDER_ENVIRONMENT_VARIABLE, str(stand_in))
    started = Blender(blender_command())
    assert started.version == rendering.version
    started.close()


def test_light_is_as_bright_as_in_drakes_renderer(rendering: Blender) -> None:
    """A white plane under an irradiance of 1 is white, of 1/2 sRGB 188; from a lamp that faces it,
    one at 60 degrees, one that goes with the camera, and from all around."""
    plane = surface(trimesh.creation.box((4.0, 4.0, 0.1)), WHITE_CHALK)
    down, flat = (0.0, 0.0, -1.0), (np.sqrt(0.75), 0.0, -0.5)
    grey = cv2.imencode(".hdr", np.full((16, 32, 3), 0.5, np.float32))[1].tobytes()
    for scene, expected in (
        (BlenderScene((plane,), (lamp(down, irradiance=0.5 * np.pi),)), 188),
        (BlenderScene((plane,), (lamp(flat),)), 188),
        (BlenderScene((plane,), (lamp((0.0, 0.0, 1.0), irradiance=1.57, frame="camera"),)), 188),
        (BlenderScene((plane,), (), grey), 188),
        (BlenderScene((plane,), ()), 0),
    ):
        image = image_of(rendering, scene)
        assert image[..., 3].min() == 255
        assert np.allclose(image[..., :3].mean(axis=(0, 1)), expected, atol=4.0)


def test_light_from_where_the_room_has_it(rendering: Blender) -> None:
    """Bright columns of the room's picture light the side of a ball that they are on."""
    ball = surface(trimesh.creation.icosphere(4, 0.1), WHITE_CHALK)
    for column, along in ((32, (1.0, 0.0)), (16, (0.0, 1.0)), (48, (0.0, -1.0))):
        room = np.zeros((32, 64, 3), np.float32)
        room[12:20, column - 2 : column + 2] = 20.0
        scene = BlenderScene((ball,), (), cv2.imencode(".hdr", room)[1].tobytes())
        camera = Intrinsics(width=80, height=80, focal=(200.0, 200.0), center=(39.5, 39.5))
        image = image_of(rendering, scene, DOWN, camera)[..., 0].astype(float)
        y, x = np.mgrid[:80, :80] - 39.5
        middle = np.array([(image * x).sum(), (image * -y).sum()]) / image.sum()
        assert middle / np.linalg.norm(middle) == pytest.approx(along, abs=0.1)


def test_shadows(rendering: Blender) -> None:
    parts = (
        surface(trimesh.creation.box((2.0, 2.0, 0.02)), WHITE_CHALK),
        surface(trimesh.creation.box((0.1, 0.1, 0.2)), WHITE_CHALK),
    )
    found = [
        image_of(rendering, BlenderScene(parts, (lamp((1.0, 0.0, -1.0), shadows=shadows),)))
        for shadows in (True, False)
    ]
    right_of_it = (slice(60, 80), slice(92, 100))
    assert found[0][right_of_it][..., :3].max() < 120
    assert found[1][right_of_it][..., :3].min() > 190


def test_the_same_bytes_on_any_number_of_threads(
    rendering: Blender, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball = surface(trimesh.creation.icosphere(3, 0.1), Material())
    table = surface(trimesh.creation.box((2.0, 2.0, 0.02)), Material(color=(0.5, 0.4, 0.3, 1.0)))
    scene = BlenderScene((ball, table), (lamp((1.0, 0.3, -1.0), angle=0.1),), samples=4)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    first = image_of(rendering, scene)
    aside = image_of(rendering, scene, DOWN @ make_pose(p_AB=(0.05, 0.0, 0.0)))
    assert not np.array_equal(first, aside)
    assert np.array_equal(first, image_of(rendering, scene))
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    other = Blender(blender_command())
    assert np.array_equal(first, image_of(other, scene))
    other.close()


@pytest.fixture(scope="module")
def small() -> View:
    board = station_view(burg.load_station("panda_tabletop"), "board")
    one = board.intrinsics
    camera = Intrinsics(
        width=160,
        height=120,
        focal=(one.focal[0] / 4, one.focal[1] / 4),
        center=((one.center[0] + 0.5) / 4 - 0.5, (one.center[1] + 0.5) / 4 - 0.5),
    )
    return View(camera="small", intrinsics=camera, X_SC=board.X_SC)


def test_it_looks_like_drakes(rendering: Blender, small: View) -> None:
    """Table, board and objects have their colours in the same places; shadows are darker."""
    ours, drakes = (
        burg.render("tabletop_six", "panda_tabletop", small, renderer=renderer)
        for renderer in ("blender", "drake")
    )
    assert np.array_equal(ours.labels, drakes.labels) and np.array_equal(ours.depth, drakes.depth)
    assert ours.color is not None and drakes.color is not None
    apart = np.abs(ours.color.astype(int) - drakes.color).max(axis=2)
    assert (apart < 40).mean() > 0.85 and (apart > 0).mean() > 0.3
    behind = cv2.erode((ours.depth == 0.0).astype(np.uint8), np.ones((5, 5))).astype(bool)
    assert behind.any() and (ours.color[behind] == NO_APPEARANCE_COLOR).all()


def test_a_lens_bends_the_picture_as_the_labels(rendering: Blender, small: View) -> None:
    bent = replace(small.intrinsics, distortion=(-0.28, 0.09, 0.001, -0.0005))
    renderer = SceneRenderer("tabletop_six", "panda_tabletop", renderer="blender")
    straight, lens = renderer.images(small), renderer.images(replace(small, intrinsics=bent))
    assert np.count_nonzero(straight.labels != lens.labels) > 50
    yellow = [one.color[one.labels == 6].astype(float).mean(axis=0) for one in (straight, lens)]
    assert np.allclose(*yellow, atol=8.0)


def test_a_data_set(rendering: Blender, tmp_path: Path) -> None:
    """Its labels are those of one with Drake's renderer; each sample can be made again."""
    data = {}
    for renderer in ("blender", "drake"):
        recipe = burg.dataset.DatasetRecipe(
            renderer=renderer, views=1, sensor="d435", size=(160, 120)
        )
        folder = tmp_path / renderer
        made = burg.generate_dataset(["tabletop_six"], "panda_tabletop", folder, recipe)
        assert not made.failed
        data[renderer] = burg.load_dataset(folder)
    ours, drakes = (data[name].read(0) for name in ("blender", "drake"))
    for kind in ("depth", "labels"):
        assert np.array_equal(getattr(ours.images, kind), getattr(drakes.images, kind))
    assert not np.array_equal(ours.images.color, drakes.images.color)
    again = burg.dataset.sample_again(data["blender"], ours.key)
    assert np.array_equal(again.images.color, ours.images.color)
    assert data["blender"].document.versions["blender"] == rendering.version
    assert "blender" not in data["drake"].document.versions
    assert burg.dataset.check_generated(tmp_path / "blender") == []
