"""A check that is asked again and again says what a new one says, and what a linear program says of
each pair of convex pieces."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
from scipy.spatial import ConvexHull

from burg_drake.core import Array, InvalidInputError, Pose, UnknownNameError, transform_points
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Instance, Scene, SceneDocument, SceneIssue
from burg_drake.station import Obstacle, SceneCheck, Station, StationDocument, Table, load_station

CUT = ("mug", "bowl", "banana", "scissors", "screwdriver", "airplane")
"""Objects that touch others with convex pieces, which the linear program reads from their files."""


@pytest.fixture(scope="module")
def library() -> ObjectLibrary:
    return load_library("household")


@pytest.fixture(scope="module")
def panda() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def bare(panda: Station) -> Station:
    """A table and a wall, no arm; the board is turned and lies beside the world's origin."""
    document = StationDocument(
        name="bare",
        table=Table(size=(3.0, 3.0, 0.1)),
        X_WS=Pose((0.3, -0.2, 0.0), rpy_deg=(0.0, 0.0, 30.0)),
        background={"wall": Obstacle(X_WB=Pose((-1.0, 0.0, 0.1)), size=(0.1, 1.0, 0.2))},
    )
    return Station(document, panda.hand, panda.hand_model, None, Path("bare.yaml"))


@pytest.fixture(scope="module")
def check(bare: Station, library: ObjectLibrary) -> SceneCheck:
    return SceneCheck(bare, library)


@pytest.fixture
def scene(library: ObjectLibrary) -> Callable[..., Scene]:
    def make(*instances: Instance, background: tuple[Instance, ...] = ()) -> Scene:
        document = SceneDocument(
            name="test", library="household", instances=instances, background=background
        )
        return Scene(document, library, Path("scene.yaml"))

    return make


MakeScene = Callable[..., Scene]


def instance(
    name: str, kind: str, x: float, y: float, z: float = 0.0, yaw: float = 0.0
) -> Instance:
    return Instance(name=name, object=kind, X_SO=Pose((x, y, z), rpy_deg=(0.0, 0.0, yaw)))


def anywhere(name: str, kind: str, rng: np.random.Generator, room: float = 0.15) -> Instance:
    """In any posture, within a cube over the board."""
    x, y, z = rng.uniform(0.1, 0.1 + room, 3)
    rpy = np.rad2deg(rng.uniform(-np.pi, np.pi, 3))
    return Instance(name=name, object=kind, X_SO=Pose((x, y, z), rpy_deg=tuple(rpy)))


def test_random_heaps_overlap_as_a_linear_program_says(
    check: SceneCheck, scene: MakeScene, library: ObjectLibrary
) -> None:
    """A ball of radius r in what two pieces have in common: they overlap by 2 r at least, and
    where there is none, not at all."""
    rng = np.random.default_rng(3)
    pieces = {
        name: [np.asarray(library.mesh(p).vertices) for p in library.entry(name).pieces]
        for name in CUT
    }
    told = silent = 0
    for _ in range(4):
        kinds = rng.choice(CUT, 4)
        heap = scene(*(anywhere(f"{k}_{i}", k, rng) for i, k in enumerate(kinds)))
        found = {(i.instance, i.other) for i in check.issues(heap) if i.kind == "overlap"}
        placed = {
            name: [transform_points(heap.X_SO(name), p) for p in pieces[one.object]]
            for name, one in heap.instances.items()
        }
        for a, b in itertools.combinations(heap.instances, 2):
            radius = _common_ball(placed[a], placed[b])
            if (a, b) in found:
                assert radius > 0.0, (a, b)
                told += 1
            else:
                assert radius < 0.5e-3, (a, b)
                silent += radius < -1e-4
    assert told >= 5 and silent >= 5


def test_edits_in_a_row_end_where_a_new_check_begins(
    check: SceneCheck, scene: MakeScene, bare: Station, library: ObjectLibrary
) -> None:
    """Moved, added, removed, renamed, exchanged, fixed and freed: nothing of the past remains."""
    rng = np.random.default_rng(5)
    shown = [anywhere(f"o{i}", k, rng) for i, k in enumerate(("can", "can", "box", "banana"))]
    fixed: list[Instance] = []
    told = 0
    for step in range(14):
        k = int(rng.integers(len(shown)))
        match step % 7:
            case 0:
                shown[k] = dataclasses.replace(shown[k], X_SO=anywhere("", "box", rng).X_SO)
            case 1:
                shown.append(anywhere(f"new_{step}", "banana", rng))
            case 2:
                del shown[k]
            case 3:
                shown[k] = dataclasses.replace(shown[k], name=f"renamed_{step}")
            case 4:
                shown[k] = dataclasses.replace(shown[k], object="marble")
            case 5:
                fixed.append(shown.pop(k))
            case 6:
                shown.append(fixed.pop())
        now = scene(*shown, background=tuple(fixed))
        issues = check.issues(now)
        assert issues == SceneCheck(bare, library).issues(now), step
        assert issues == check.issues(now), step
        told += any(issue.kind == "overlap" for issue in issues)
    assert told >= 5


def test_the_order_of_instances_does_not_matter(check: SceneCheck, scene: MakeScene) -> None:
    rng = np.random.default_rng(7)
    heap = [anywhere(f"o{i}", k, rng) for i, k in enumerate(("mug", "bowl", "can", "banana"))]

    def pairs(issues: tuple[SceneIssue, ...]) -> dict[frozenset[str], float]:
        return {frozenset((i.instance, i.other)): i.amount for i in issues if i.kind == "overlap"}

    expected = pairs(check.issues(scene(*heap)))
    assert len(expected) >= 3
    for order in itertools.permutations(heap):
        found = check.issues(scene(*order))
        assert pairs(found) == pytest.approx(expected, abs=1e-9)
        names = [one.name for one in order]
        overlapping = [i for i in found if i.kind == "overlap" and i.other in names]
        assert all(names.index(i.instance) < names.index(i.other) for i in overlapping)


def test_background_that_overlaps(check: SceneCheck, scene: MakeScene) -> None:
    """A free object that overlaps a fixed one is told; two fixed ones are furniture."""
    wall, shelf = instance("wall_box", "box", 0.2, 0.2), instance("shelf", "box", 0.21, 0.2)
    (issue,) = check.issues(scene(instance("can", "can", 0.2, 0.2), background=(wall,)))
    assert (issue.instance, issue.other) == ("can", "wall_box")
    assert check.issues(scene(background=(wall, shelf))) == ()


def test_kinds_of_issues(check: SceneCheck, scene: MakeScene) -> None:
    def kinds(x: float, y: float, z: float) -> list[str]:
        return [i.kind for i in check.issues(scene(instance("can", "can", x, y, z)))]

    assert kinds(0.2, 0.2, 0.0) == []
    assert kinds(-0.5, 0.2, 0.0) == ["out_of_bounds"]
    assert kinds(0.2, 0.2, -0.05) == ["in_ground"]
    assert kinds(0.2, 0.2, -5.0) == ["in_ground"]
    assert kinds(0.2, 0.2, 0.05) == ["hovering"]
    assert kinds(-0.5, 0.2, -0.05) == ["out_of_bounds", "in_ground"]
    assert kinds(5.0, 0.2, 0.0) == ["out_of_bounds", "out_of_bounds"]  # and beside the table
    assert kinds(1e5, 0.2, 0.0) == ["out_of_bounds", "out_of_bounds"]


@pytest.mark.parametrize("gap", [0.9e-3, 5e-3])
def test_what_hovers_is_told_with_what_is_below_it(
    gap: float, check: SceneCheck, scene: MakeScene
) -> None:
    """Above the board, another object, an obstacle of the station, and nothing."""
    stack = scene(
        instance("box", "box", 0.15, 0.2, gap),
        instance("can", "can", 0.15, 0.2, 0.21 + 2 * gap),
        background=(instance("shelf", "box", 0.4, 0.2),),
    )
    on_shelf = scene(
        instance("can", "can", 0.4, 0.2, 0.21 + gap), background=tuple(stack.background.values())
    )
    found = [(i.kind, i.instance, i.other, i.amount) for i in check.issues(stack)]
    found += [(i.kind, i.instance, i.other, i.amount) for i in check.issues(on_shelf)]
    expected = [("box", "board"), ("can", "box"), ("can", "shelf")] if gap > 1e-3 else []
    assert found == [("hovering", *names, pytest.approx(gap, abs=1e-6)) for names in expected]
    if expected:
        assert check.issues(stack)[1].message == (
            "'can' hovers 5.0 mm above 'box'; it will fall when simulated"
        )
    over_wall = scene(instance("can", "can", *_over_the_wall(), 0.2 + gap))
    issues = [i for i in check.issues(over_wall) if i.kind == "hovering"]
    assert [(i.other, i.amount) for i in issues] == [
        ("wall", pytest.approx(gap, abs=1e-6)) for _ in expected[:1]
    ]
    found_beside = check.issues(scene(instance("can", "can", 5.0, 0.2, 0.3)))
    (beside,) = [i for i in found_beside if i.kind == "hovering"]
    assert beside.message == "'can' has nothing below it; it will fall when simulated"


def _over_the_wall() -> tuple[float, float]:
    """x and y of the wall's middle in the scene frame [m]."""
    turned = math.radians(30.0)
    x, y = -1.0 - 0.3, 0.0 + 0.2
    return (
        math.cos(turned) * x + math.sin(turned) * y,
        math.cos(turned) * y - math.sin(turned) * x,
    )


def test_a_marble_floats_in_a_mug(
    check: SceneCheck, scene: MakeScene, library: ObjectLibrary
) -> None:
    """Its height over the mug's floor is that of a ray down the mug's own surface."""
    floor = max(
        p[2]
        for p in library.surface("mug").ray.intersects_location([[0.0, 0.0, 0.09]], [[0, 0, -1]])[0]
    )
    mug = instance("mug", "mug", 0.2, 0.2)
    for height in (0.05, 0.02, floor):
        issues = check.issues(scene(mug, instance("marble", "marble", 0.2, 0.2, height)))
        if height == floor:
            assert issues == ()
            continue
        (issue,) = issues
        assert (issue.kind, issue.instance, issue.other) == ("hovering", "marble", "mug")
        assert issue.amount == pytest.approx(height - floor, abs=1.5e-3)  # pieces, and their excess


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (Pose((math.nan, 0.2, 0.0)), "has NaN or infinite numbers"),
        (Pose((0.2, math.inf, 0.0)), "has NaN or infinite numbers"),
        (Pose((0.2, 0.2, 0.0), rpy_deg=(0.0, math.nan, 0.0)), "has NaN or infinite numbers"),
        (Pose((1e9, 0.2, 0.0)), "is more than 1e+06 m from the origin; give metres"),
    ],
)
def test_numbers_that_are_no_place(
    check: SceneCheck, scene: MakeScene, pose: Pose, message: str
) -> None:
    fine = scene(instance("can", "can", 0.2, 0.2))
    with pytest.raises(InvalidInputError) as refused:
        check.issues(scene(instance("can", "can", 0.2, 0.2), Instance(object="mug", X_SO=pose)))
    assert str(refused.value) == f"scene.yaml: X_SO of 'mug' {message}" + (
        "; give finite metres and angles" if "NaN" in message else ""
    )
    assert check.issues(fine) == ()


def test_unknown_objects_foreign_scenes_and_taken_names(
    check: SceneCheck, scene: MakeScene, library: ObjectLibrary, tmp_path: Path
) -> None:
    with pytest.raises(UnknownNameError, match="object 'mugg' is not in library"):
        check.issues(scene(instance("a", "mugg", 0.2, 0.2)))
    with pytest.raises(InvalidInputError, match="something called 'table' already"):
        check.issues(scene(instance("table", "mug", 0.2, 0.2)))
    with pytest.raises(InvalidInputError, match=r"bare.yaml: background.wall:"):
        check.issues(scene(instance("wall", "mug", 0.2, 0.2)))
    elsewhere = dataclasses.replace(scene(), library=ObjectLibrary(library.document, tmp_path))
    with pytest.raises(InvalidInputError, match="library"):
        check.issues(elsewhere)


def test_an_instance_may_have_the_name_of_a_link(
    scene: MakeScene, panda: Station, library: ObjectLibrary
) -> None:
    """The link goes on being looked at, too: the box stands where it is."""
    X_SW = np.linalg.inv(panda.document.X_WS.matrix())
    x, y = X_SW[:2, 3]
    namesake = scene(instance("panda_link0", "box", x, y))
    found = [i for i in SceneCheck(panda, library).issues(namesake) if i.kind == "overlap"]
    assert ("panda_link0", "panda_link0") in {(i.instance, i.other) for i in found}


def _common_ball(a: list[Array], b: list[Array]) -> float:
    """Radius of the largest ball within a piece of `a` and one of `b`; negative if there is no
    such point [m]."""
    found = -math.inf
    for p, q in itertools.product(a, b):
        if (p.min(axis=0) > q.max(axis=0)).any() or (q.min(axis=0) > p.max(axis=0)).any():
            continue
        planes = np.vstack([ConvexHull(p).equations, ConvexHull(q).equations])
        result = scipy.optimize.linprog(
            [0.0, 0.0, 0.0, -1.0],
            A_ub=np.column_stack([planes[:, :3], np.ones(len(planes))]),
            b_ub=-planes[:, 3],
            bounds=[(None, None)] * 4,
        )
        found = max(found, float(result.x[3]))
    return found
