"""What stands where it does not belong: extra objects, objects on each other's places, and what
several photos say together."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from burg_drake.cameras import (
    CheckedImage,
    CheckedScene,
    ExtraObject,
    Intrinsics,
    PinholeView,
    Placement,
    PlacementCheck,
    SilhouetteAligner,
    combine_checks,
    empty_board,
    find_exchanged_objects,
    find_extra_objects,
    locate_objects,
    target_shape,
)
from burg_drake.core import InvalidInputError, Pose, make_pose, rot_z
from tests.cameras.plates import BOARD, INTRINSICS, VIEW, X_SC, aligner, cover, drawing, plate
from tests.cameras.synthetic import ImageDegradation, board_image

LOOK = ImageDegradation(blur=0.7, noise=2.0)
HERE, THERE = (0.30, 0.19, 0.3), (0.40, 0.23, 0.3)
LONG, SHORT = (0.09, 0.03), (0.05, 0.05)
ON_PLACE = np.zeros(3)


def test_what_is_no_object_of_the_scene_is_named_where_it_stands() -> None:
    there = aligner(drawing([cover(LONG, HERE, ON_PLACE), cover(SHORT, THERE, ON_PLACE)], LOOK))
    shape = plate(LONG, HERE)
    (extra,) = find_extra_objects(there, [(shape, ON_PLACE)])
    assert np.hypot(*np.subtract(extra.position, THERE[:2])) < 0.015
    assert extra.width == pytest.approx(0.06, abs=0.02)
    assert find_extra_objects(there, [(shape, ON_PLACE), (plate(SHORT, THERE), ON_PLACE)]) == ()


def test_straight_below_the_camera_it_is_named_in_its_middle() -> None:
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (*THERE[:2], 0.8))
    covers = np.array([cover(SHORT, THERE, ON_PLACE)])
    image = board_image(BOARD, INTRINSICS, X_SC, covers=covers)
    picture = empty_board(BOARD, image, INTRINSICS.K, X_SC)
    assert picture is not None
    view = PinholeView(INTRINSICS.K, (INTRINSICS.width, INTRINSICS.height), X_SC)
    (extra,) = find_extra_objects(SilhouetteAligner(view, image, picture), [])
    assert np.hypot(*np.subtract(extra.position, THERE[:2])) < 0.004
    assert extra.width == pytest.approx(0.056, abs=0.012)  # of a disk as large


def test_objects_on_each_others_places_are_told() -> None:
    there = aligner(drawing([cover(SHORT, HERE, ON_PLACE), cover(LONG, THERE, ON_PLACE)], LOOK))
    shapes = {"long": plate(LONG, HERE), "short": plate(SHORT, THERE)}
    located = locate_objects(there, shapes)
    stands, _ = find_exchanged_objects(there, shapes, located, ["long", "short"])
    assert {place: name for place, (name, _) in stands.items()} == {
        "long": "short",
        "short": "long",
    }
    for _, q in (placed for _, placed in stands.values()):
        assert np.abs(q[:2]).max() < 1.5e-3


def test_objects_on_their_own_places_are_not() -> None:
    there = aligner(drawing([cover(LONG, HERE, ON_PLACE), cover(SHORT, THERE, ON_PLACE)], LOOK))
    shapes = {"long": plate(LONG, HERE), "short": plate(SHORT, THERE)}
    located = locate_objects(there, shapes)
    assert find_exchanged_objects(there, shapes, located, ["long", "short"]) == ({}, set())


def test_what_stands_behind_an_object_is_named_where_its_hidden_foot_may_be() -> None:
    """A box, drawn by its corners, hides the near part of a plate."""
    square, middle = (0.08, 0.08), np.array([0.28, 0.17])
    away = (middle - X_SC[:2, 3]) / np.linalg.norm(middle - X_SC[:2, 3])
    place = (*middle, np.arctan2(away[1], away[0]))
    size, X_SB = (0.04, 0.12, 0.05), make_pose(rot_z(place[2]), (*(middle - 0.08 * away), 0.025))
    mesh = trimesh.creation.box(size)
    box = target_shape(mesh.vertices, mesh.faces, X_SB)
    image = drawing([cover(square, place, ON_PLACE)], LOOK)
    corners = cv2.convexHull(VIEW.project(box.p_SV)[1].astype(np.float32))
    cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), (200, 60, 40))
    (extra,) = find_extra_objects(aligner(image), [(box, ON_PLACE)])
    assert np.hypot(*np.subtract(extra.position, middle)) < 0.02


@pytest.mark.parametrize(("place", "told"), [((0.48, 0.33, 0.3), True), ((0.51, 0.34, 0.3), False)])
def test_an_object_stands_on_anothers_place_only_if_enough_of_it_is_seen(
    place: tuple[float, float, float], told: bool
) -> None:
    """66 and 30 % of it are in the image, and nothing else stands anywhere."""
    there = aligner(drawing([cover(LONG, place, ON_PLACE)], LOOK))
    shapes = {"long": plate(LONG, HERE), "short": plate(SHORT, place)}
    located = locate_objects(there, shapes)
    stands, _ = find_exchanged_objects(there, shapes, located, ["long", "short"])
    assert {place: name for place, (name, _) in stands.items()} == (
        {"short": "long"} if told else {}
    )


def test_what_an_object_left_its_place_to_may_be_the_one_that_is_missing() -> None:
    """A strip is all that is seen of the short plate, where the long one belongs."""
    strip = cover((0.05, 0.02), HERE, ON_PLACE)
    there = aligner(drawing([strip, cover(LONG, THERE, ON_PLACE)], LOOK))
    shapes = {"long": plate(LONG, HERE), "short": plate(SHORT, THERE)}
    located = locate_objects(there, shapes)
    stands, empty = find_exchanged_objects(there, shapes, located, ["long", "short"])
    assert {place: name for place, (name, _) in stands.items()} == {"short": "long"}
    assert empty == {"long"}
    placed = [where for _, where in stands.values()]
    (strip_seen,) = find_extra_objects(there, placed)
    assert np.hypot(*np.subtract(strip_seen.position, HERE[:2])) < 0.02
    assert find_extra_objects(there, placed, [shapes["long"].p_SR]) == ()
    assert find_extra_objects(there, placed, [shapes["short"].p_SR]) == (strip_seen,)


def mug(x: float, sd: float, angle: float = 0.1, **changes: object) -> Placement:
    """A placement of a mug that is off along x."""
    placed = Placement(
        object="mug",
        status="measured",
        target=Pose(translation=(0.2, 0.1, 0.0)),
        measured=Pose(translation=(0.2 + x, 0.1, 0.0)),
        reference=(0.01, 0.0, 0.0),
        displacement=(x, 0.0),
        displacement_sd=(sd, 1e-3),
        angle=angle,
        angle_sd=0.02,
        seen=0.8,
    )
    return replace(placed, **changes)  # type: ignore[arg-type]


def check(
    placement: Placement, extra: tuple[ExtraObject, ...] = (), scene: str = "a"
) -> PlacementCheck:
    return PlacementCheck(
        scene=CheckedScene(name="scene", content=scene),
        method="silhouette",
        image=CheckedImage(content=f"{placement.displacement}"),
        intrinsics=Intrinsics(width=64, height=48, focal=(60.0, 60.0), center=(31.5, 23.5)),
        instances={"mug": placement},
        extra=extra,
    )


def test_photos_are_weighted_by_their_variances() -> None:
    both = combine_checks([check(mug(1.0e-3, 1e-3)), check(mug(2.0e-3, 0.5e-3))])
    found = both.instances["mug"]
    assert found.status == "measured"
    assert found.displacement == pytest.approx((1.8e-3, 0.0))  # weights 1 and 4
    assert found.displacement_sd == pytest.approx((1e-3 / np.sqrt(5.0), 1e-3 / np.sqrt(2.0)))
    assert found.angle_sd == pytest.approx(0.02 / np.sqrt(2.0))
    assert len(both.more_images) == 1
    assert found.measured is not None
    X_SO = found.measured.matrix()  # the reference point moved as told, the object turned
    np.testing.assert_allclose((X_SO @ (0.01, 0.0, 0.0, 1.0))[:3], (0.2118, 0.1, 0.0), atol=1e-9)
    assert np.arctan2(X_SO[1, 0], X_SO[0, 0]) == pytest.approx(0.1)


def test_angles_are_averaged_across_half_a_turn() -> None:
    photos = [check(mug(0.0, 1e-3, angle=np.pi - 0.01)), check(mug(0.0, 1e-3, angle=-np.pi + 0.03))]
    found = combine_checks(photos).instances["mug"]
    assert found.status == "measured"
    assert found.angle == pytest.approx(-np.pi + 0.01)


def test_photos_that_contradict_each_other_make_an_object_uncertain() -> None:
    found = combine_checks([check(mug(0.0, 1e-4)), check(mug(4e-3, 1e-4))]).instances["mug"]
    assert found.status == "uncertain"
    assert found.reason == "the photos disagree by 2.0 mm and 0.0 deg"
    assert found.displacement_sd is not None
    assert found.displacement_sd[0] == pytest.approx(2e-3)


def test_what_one_photo_measures_another_one_may_not_see() -> None:
    hidden = Placement(object="mug", status="not_seen", reason="hidden", target=Pose())
    doubtful = mug(9e-3, 5e-3, status="uncertain", reason="only 30 % of it can be seen")
    photos = [check(hidden), check(mug(1e-3, 1e-3)), check(doubtful)]
    assert combine_checks(photos).instances["mug"] == mug(1e-3, 1e-3)
    assert combine_checks([photos[0], photos[2]]).instances["mug"] == doubtful


def test_a_photo_that_shows_that_an_object_is_gone_contradicts() -> None:
    reason = "nothing like it was found within 50 mm of its target"
    gone = Placement(object="mug", status="not_seen", reason=reason, target=Pose(), seen=0.9)
    found = combine_checks([check(mug(1e-3, 1e-3)), check(gone)]).instances["mug"]
    assert found.status == "uncertain"
    assert found.reason == f"1 of 2 photos show that it is not there: {reason}"


def test_extra_objects_of_all_photos_are_named_once() -> None:
    first = ExtraObject(position=(0.10, 0.10), width=0.05)
    again = ExtraObject(position=(0.12, 0.10), width=0.06)
    other = ExtraObject(position=(0.40, 0.10), width=0.03)
    both = combine_checks([check(mug(0, 1e-3), (first,)), check(mug(0, 1e-3), (again, other))])
    assert [e.position for e in both.extra] == [pytest.approx((0.11, 0.10)), other.position]


def test_checks_of_different_scenes_are_not_combined() -> None:
    with pytest.raises(InvalidInputError, match="different scenes"):
        combine_checks([check(mug(0, 1e-3)), check(mug(0, 1e-3), scene="b")])
    with pytest.raises(InvalidInputError, match="give at least one"):
        combine_checks([])
