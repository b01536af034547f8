"""Bounds and ground, by closed form: boxes whose corners are known."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.scene import Scene, read_vertices, require_no_errors, validate_scene

MakeScene = Callable[..., Scene]


def test_objects_on_the_board_are_fine(make_scene: MakeScene) -> None:
    assert validate_scene(make_scene(("cube", (0.3, 0.2, 0.0)), ("slab", (0.11, 0.06, 0.0)))) == ()


def test_touching_all_edges_is_in_bounds(make_scene: MakeScene) -> None:
    assert (
        validate_scene(make_scene(("cube", (0.03, 0.03, 0.0)), ("cube", (0.57, 0.37, 0.0)))) == ()
    )


@pytest.mark.parametrize(
    ("translation", "amount", "side"),
    [
        ((0.01, 0.2, 0.0), 0.02, "left"),
        ((0.595, 0.2, 0.0), 0.025, "right"),
        ((0.3, 0.025, 0.0), 0.005, "lower"),
        ((0.3, 0.41, 0.0), 0.04, "upper"),
    ],
)
def test_out_of_bounds_tells_side_and_distance(
    make_scene: MakeScene, translation: tuple[float, float, float], amount: float, side: str
) -> None:
    (issue,) = validate_scene(make_scene(("cube", translation)))
    assert (issue.instance, issue.kind, issue.is_error) == ("cube_0", "out_of_bounds", True)
    assert issue.amount == pytest.approx(amount, abs=1e-9)
    assert (
        f"{amount * 1e3:.1f} mm over the {side} edge of the board (600 x 400 mm)" in issue.message
    )


def test_the_turned_footprint_counts(make_scene: MakeScene) -> None:
    # A cube of edge a that is turned by 45 degrees reaches a / sqrt(2) from its centre.
    reach = 0.06 / math.sqrt(2)
    inside = make_scene(("cube", (reach + 1e-3, 0.2, 0.0), (0.0, 0.0, 45.0)))
    assert validate_scene(inside) == ()
    (issue,) = validate_scene(make_scene(("cube", (0.03, 0.2, 0.0), (0.0, 0.0, 45.0))))
    assert issue.amount == pytest.approx(reach - 0.03, abs=1e-9)


def test_a_corner_names_both_sides(make_scene: MakeScene) -> None:
    (issue,) = validate_scene(make_scene(("cube", (0.0, 0.42, 0.0))))
    assert "50.0 mm over the upper edge and 30.0 mm over the left edge" in issue.message
    assert issue.amount == pytest.approx(0.05)


def test_millimetres_are_suspected(make_scene: MakeScene) -> None:
    (issue,) = validate_scene(make_scene(("cube", (300.0, 200.0, 0.0))))
    assert issue.kind == "out_of_bounds"
    assert issue.message.endswith("translations are in metres")


def test_in_the_ground(make_scene: MakeScene) -> None:
    assert validate_scene(make_scene(("cube", (0.3, 0.2, -0.0009)))) == ()
    (issue,) = validate_scene(make_scene(("cube", (0.3, 0.2, -0.012))))
    assert (issue.kind, issue.is_error) == ("in_ground", True)
    assert issue.amount == pytest.approx(0.012)


def test_upside_down_is_in_the_ground(make_scene: MakeScene) -> None:
    (issue,) = validate_scene(make_scene(("cube", (0.3, 0.2, 0.0), (180.0, 0.0, 0.0))))
    assert issue.amount == pytest.approx(0.06)


def test_hovering_is_a_warning(make_scene: MakeScene) -> None:
    assert validate_scene(make_scene(("cube", (0.3, 0.2, 0.0009)))) == ()
    (issue,) = validate_scene(make_scene(("cube", (0.3, 0.2, 0.0011))))
    assert issue.amount == pytest.approx(0.0011)
    (issue,) = validate_scene(make_scene(("cube", (0.3, 0.2, 0.02))))
    assert (issue.kind, issue.is_error) == ("hovering", False)
    assert issue.amount == pytest.approx(0.02)


def test_standing_on_another_object_is_not_hovering(make_scene: MakeScene) -> None:
    on_slab = ("cube", (0.3, 0.2, 0.02))
    assert validate_scene(make_scene(("slab", (0.3, 0.2, 0.0)), on_slab)) == ()
    assert validate_scene(make_scene(on_slab, background=(("slab", (0.3, 0.2, 0.0)),))) == ()
    beside = make_scene(("slab", (0.3, 0.3, 0.0)), ("cube", (0.3, 0.1, 0.02)))
    assert [issue.kind for issue in validate_scene(beside)] == ["hovering"]


def test_hovering_names_the_box_below(make_scene: MakeScene) -> None:
    high = make_scene(("slab", (0.3, 0.2, 0.0)), ("cube", (0.3, 0.2, 0.2)), ("slab", (0.3, 0.1, 0)))
    top = read_vertices(high.library.path("slab/mesh.obj"))[:, 2].max()
    (issue,) = validate_scene(high)
    assert (issue.instance, issue.other) == ("cube_1", "slab_0")
    assert issue.amount == pytest.approx(0.2 - top, abs=1e-9)


def test_background_may_stand_anywhere(make_scene: MakeScene) -> None:
    assert validate_scene(make_scene(background=(("cube", (2.0, 0.2, -0.5)),))) == ()


def test_require_sound_lets_warnings_pass(make_scene: MakeScene) -> None:
    scene = make_scene(("cube", (0.3, 0.2, 0.02)))
    require_no_errors(scene, validate_scene(scene))


def test_require_sound_gives_one_line(make_scene: MakeScene) -> None:
    scene = make_scene(("cube", (0.0, 0.2, 0.0)), ("cube", (0.3, 0.2, -0.5)))
    with pytest.raises(InvalidInputError) as caught:
        require_no_errors(scene, validate_scene(scene))
    assert str(caught.value) == (
        f"{scene.path}: 'cube_0' is off the board: 30.0 mm over the left edge of the board"
        " (600 x 400 mm) (and 1 more; burg-drake scene validate lists all)"
    )


def test_read_vertices_reads_vertices_only(make_scene: MakeScene) -> None:
    scene = make_scene(("cube", (0.3, 0.2, 0.0)))
    vertices = read_vertices(scene.library.path("cube/mesh.obj"))
    assert vertices.shape == (8, 3)
    assert vertices.min(axis=0) == pytest.approx([-0.03, -0.03, 0.0])


@pytest.mark.parametrize("content", [b"# empty\n", b"v 0 0 0\nv 1 2\n", b"v 0 0 inf\n", b"\x8b"])
def test_damaged_meshes(make_scene: MakeScene, content: bytes) -> None:
    scene = make_scene(("cube", (0.3, 0.2, 0.0)))
    scene.library.path("cube/mesh.obj").write_bytes(content)
    with pytest.raises(InvalidInputError, match=r"cube/mesh.obj is damaged or not a mesh; build"):
        validate_scene(scene)
