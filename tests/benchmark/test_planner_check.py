"""The check of a planner names mistakes that are planted here, and its lines of Python undo them.

Right grasps of the carton and the can follow from their sizes. Mistakes are planted with NumPy and
SciPy, and share nothing with the search for them.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from burg_drake import benchmark
from burg_drake.apps import main
from burg_drake.benchmark import (
    CheckScene,
    PlannerCheck,
    PlannerError,
    check_answers,
    check_planner,
    make_check_scene,
)
from burg_drake.objects import ObjectLibrary
from tests.thorough import thorough

Poses = np.ndarray


def pose(euler_deg: tuple[float, float, float] = (0, 0, 0), p: Any = (0, 0, 0)) -> Poses:
    X = np.eye(4)
    X[:3, :3] = Rotation.from_euler("xyz", euler_deg, degrees=True).as_matrix()
    X[:3, 3] = p
    return X


X_SBOX, X_SCAN = pose((0, 0, 25), (0.2, 0.2, 0.0)), pose(p=(0.42, 0.17, 0.0))
"""Where carton (60 x 158 x 210 mm) and can (68 x 102 mm) stand, the origins at their bottoms."""


def grasp(p: Any, approach: Any, closing: Any) -> Poses:
    X = np.eye(4)
    X[:3, 2], X[:3, 0] = approach, closing
    X[:3, 1] = np.cross(X[:3, 2], X[:3, 0])
    X[:3, 3] = p
    return X


def from_above(count: int, seed: int = 0) -> Poses:
    """Half of them on the carton, half on the can."""
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        depth, turn = rng.uniform(0.003, 0.02), rng.uniform(0.0, 2.0 * np.pi)
        y = rng.uniform(-0.05, 0.05)
        found.append(
            X_SBOX @ grasp((0.0, y, 0.21 - depth), (0, 0, -1), (1, 0, 0))
            if k % 2
            else X_SCAN
            @ grasp((0, 0, 0.102 - depth), (0, 0, -1), (np.cos(turn), np.sin(turn), 0.0))
        )
    return np.array(found)


def from_the_side(count: int, seed: int = 0, share_of_carton: float = 0.5) -> Poses:
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        sign, turn = rng.choice([-1.0, 1.0]), rng.uniform(0.0, 2.0 * np.pi)
        depth, height = rng.uniform(0.01, 0.025), rng.uniform(0.05, 0.08)
        towards = np.array([np.cos(turn), np.sin(turn), 0.0])
        found.append(
            X_SBOX @ grasp((0.0, sign * (depth - 0.079), 2.0 * height), (0, sign, 0), (1, 0, 0))
            if k < share_of_carton * count
            else X_SCAN
            @ grasp((0, 0, height) - 0.005 * towards, towards, np.cross((0, 0, 1), towards))
        )
    return np.array(found)


def both(count: int, seed: int = 0) -> Poses:
    half = count // 2
    return np.concatenate([from_above(half, seed), from_the_side(count - half, seed)])


def noisy(count: int, seed: int = 0) -> Poses:
    """With noise of 2 mm and 3 degrees."""
    rng, X = np.random.default_rng(seed), both(count, seed)
    for k in range(count):
        direction, axis = rng.normal(size=(2, 3))
        X[k] = X[k] @ pose(p=0.002 * direction / np.linalg.norm(direction))
        turn = Rotation.from_rotvec(np.deg2rad(3.0) * axis / np.linalg.norm(axis))
        X[k, :3, :3] = X[k, :3, :3] @ turn.as_matrix()
    return X


def with_bad_ones(count: int, seed: int = 0) -> Poses:
    """Every third grasp is a random one near the objects."""
    rng, X = np.random.default_rng(seed), both(count, seed)
    bad = np.arange(count) % 3 == 0
    X[bad, :3, :3] = Rotation.random(int(bad.sum()), random_state=seed).as_matrix()
    X[bad, :3, 3] += rng.normal(scale=0.03, size=(int(bad.sum()), 3))
    return X


@pytest.fixture(scope="module", autouse=True)
def meshes_read_once() -> Iterator[None]:
    """Reading and refining the two meshes is most of the work of a check."""
    surface, refine = ObjectLibrary.surface, trimesh.remesh.subdivide_to_size
    surfaces: dict[tuple[Any, str], Any] = {}
    refined: dict[bytes, Any] = {}

    def surface_once(library: ObjectLibrary, name: str) -> Any:
        key = (library.root, name)
        if key not in surfaces:
            surfaces[key] = surface(library, name)
        return surfaces[key]

    def refine_once(vertices: Any, *arguments: Any, **options: Any) -> Any:
        key = np.asarray(vertices).tobytes()
        if key not in refined:
            refined[key] = refine(vertices, *arguments, **options)
        return refined[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ObjectLibrary, "surface", surface_once)
        patch.setattr(trimesh.remesh, "subdivide_to_size", refine_once)
        yield


@pytest.fixture(scope="module")
def seen() -> CheckScene:
    return make_check_scene()


class Frames:
    """Poses of the camera, from what a planner is told."""

    def __init__(self, seen: CheckScene) -> None:
        self.X_WS, self.X_WC = seen.observations[0].X_WS, seen.observations[0].X_WC
        self.X_SC = np.linalg.inv(self.X_WS) @ self.X_WC
        self.X_CS = np.linalg.inv(self.X_SC)


RIGHT: dict[str, Callable[[Frames], dict[str, Any]]] = {
    "from above": lambda f: {"X_CG": f.X_CS @ from_above(16), "width": np.full(16, 0.065)},
    "side of the carton": lambda f: {"X_CG": f.X_CS @ from_the_side(12, share_of_carton=1.0)},
    "noisy": lambda f: {"X_CG": (f.X_CS @ noisy(40)).astype(np.float32)},
    "a third bad": lambda f: {"X_CG": f.X_CS @ with_bad_ones(18), "score": np.ones(18)},
    "in the world": lambda f: {"X_WG": f.X_WS @ both(16), "width": np.full(16, 0.085)},
    "fingers swapped": lambda f: {"X_SG": both(16) @ pose((0, 0, 180))},
    "acronym": lambda f: {
        "X_CG": f.X_CS @ both(16) @ pose(p=(0, 0, -0.1034)),
        "frame": "acronym",
    },
}


@pytest.mark.parametrize("name", RIGHT)
def test_right_planners_have_no_problem(name: str, seen: CheckScene) -> None:
    found = check_answers([RIGHT[name](Frames(seen))], seen)
    assert found.problems == ()
    fitting, tried = found.fits
    assert tried == found.count and fitting >= (0.6 if name == "a third bad" else 0.9) * tried
    assert found.unclear == ()


def quaternions_read_as_xyzw(X: Poses, quaternion: np.ndarray) -> Poses:
    X = X.copy()
    X[:, :3, :3] = Rotation.from_quat(quaternion).as_matrix()
    return X


def quaternions_read_as_wxyz(X: Poses, quaternion: np.ndarray) -> Poses:
    return quaternions_read_as_xyzw(X, quaternion[:, [1, 2, 3, 0]])


def xyzw(X: Poses) -> np.ndarray:
    return Rotation.from_matrix(X[:, :3, :3]).as_quat()


def in_millimetres(X: Poses) -> Poses:
    return np.concatenate([X[:, :, :3], X[:, :, 3:] * [[1e3], [1e3], [1e3], [1.0]]], axis=2)


def with_transposed_rotations(X: Poses) -> Poses:
    X = X.copy()
    X[:, :3, :3] = np.einsum("nij->nji", X[:, :3, :3])
    return X


OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
Plant = Callable[[Poses, Frames], dict[str, Any]]
PLANTED: dict[str, tuple[Plant, str]] = {
    "quarter turn": (
        lambda X, f: {"X_CG": f.X_CS @ X @ pose((0, 0, 90))},
        "turned by 90 degrees about the approach",
    ),
    "flange": (
        lambda X, f: {"X_CG": f.X_CS @ X @ pose(p=(0, 0, -0.1034))},
        "0.1034 m behind the point midway between the pads, at the flange or the body of the hand",
    ),
    "flange turned": (
        lambda X, f: {"X_CG": f.X_CS @ X @ pose((0, 0, -45), (0, 0, -0.1034))},
        "turned by 45 degrees about the approach and 0.1034 m behind",
    ),
    "world": (lambda X, f: {"X_CG": f.X_WS @ X}, "measured in the world frame"),
    "scene": (lambda X, f: {"X_CG": X}, "measured in the scene frame"),
    "camera": (lambda X, f: {"X_WG": f.X_CS @ X}, "measured in the camera frame"),
    "turned around": (
        lambda X, f: {"X_CG": f.X_CS @ X @ pose((180, 0, 0))},
        "z points out of the scene",
    ),
    "x is the approach": (
        lambda X, f: {"X_CG": (f.X_CS @ X)[:, :, [2, 0, 1, 3]]},
        r"their frame has \+x along the approach and y along the closing direction",
    ),
    "inverse": (lambda X, f: {"X_CG": np.linalg.inv(f.X_CS @ X)}, "are inverted"),
    "millimetres": (lambda X, f: {"X_CG": in_millimetres(f.X_CS @ X)}, "given in millimetres"),
    "transposed rotations": (
        lambda X, f: {"X_CG": with_transposed_rotations(f.X_CS @ X)},
        "given with transposed rotations",
    ),
    "transposed matrices": (
        lambda X, f: {"X_CG": np.swapaxes(f.X_CS @ X, 1, 2)},
        "matrices X_CG are transposed",
    ),
    "wxyz": (
        lambda X, f: {
            "X_CG": quaternions_read_as_xyzw(
                f.X_CS @ X, quaternion := np.roll(xyzw(f.X_CS @ X), 1, axis=1)
            ),
            "quaternion": (quaternion, quaternions_read_as_xyzw),
        },
        "quaternions in the order w, x, y, z, read as x, y, z, w",
    ),
    "xyzw": (
        lambda X, f: {
            "X_CG": quaternions_read_as_wxyz(f.X_CS @ X, quaternion := xyzw(f.X_CS @ X)),
            "quaternion": (quaternion, quaternions_read_as_wxyz),
        },
        "quaternions in the order x, y, z, w, read as w, x, y, z",
    ),
    "OpenGL": (lambda X, f: {"X_CG": OPENGL @ f.X_CS @ X}, "OpenGL's camera frame"),
    "OpenGL in the world": (
        lambda X, f: {"X_WG": f.X_WC @ OPENGL @ f.X_CS @ X},
        "OpenGL's camera frame",
    ),
    "camera the wrong way round": (
        lambda X, f: {"X_CG": f.X_WC @ f.X_WS @ X},
        "moved by the pose of the camera the wrong way round",
    ),
    "left-handed": (
        lambda X, f: {"X_CG": (f.X_CS @ X) * [1.0, -1.0, 1.0, 1.0]},
        "left-handed axes",
    ),
    "z mirrored": (
        lambda X, f: {"X_CG": (f.X_CS @ X) * [1.0, 1.0, -1.0, 1.0]},
        "left-handed axes.*z points out of the scene",
    ),
    "half widths": (
        lambda X, f: {"X_CG": f.X_CS @ X, "width": np.full(len(X), 0.032)},
        "widths are half of the distance",
    ),
    "widths in millimetres": (
        lambda X, f: {"X_CG": f.X_CS @ X, "width": np.full(len(X), 64.0)},
        "widths are in millimetres",
    ),
    "named acronym": (
        lambda X, f: {"X_CG": f.X_CS @ X, "frame": "acronym"},
        '0.1034 m ahead of .* or set "frame": "burg_drake" in the answer',
    ),
}
"""How each mistake is made, and what the problem says."""
ASKED = {"from above": from_above, "from the side": from_the_side, "noisy": noisy, "both": both}
PAIRS = [
    (mistake, planner)
    for k, mistake in enumerate(PLANTED)
    for planner in (("from the side", "both"), ("noisy", "from above"), ("both", "noisy"))[k % 3]
]


def corrected(answer: dict[str, Any], found: PlannerCheck, seen: CheckScene) -> dict[str, Any]:
    """The answer after the lines of the problems were added to the planner."""
    lines = [problem.split("\n    ")[1] for problem in found.problems]
    order = answer.get("quaternion")
    names = {key: np.copy(value) for key, value in answer.items() if key != "quaternion"}
    names |= {"np": np, "observation": seen.observations[0], "quaternion": order and order[0]}
    for line in lines:
        if line.startswith("return "):
            return dict(eval(line.removeprefix("return "), names))
        exec(line, names)
    if order is not None:
        names["X_CG"] = order[1](answer["X_CG"], names["quaternion"])
    return {key: names[key] for key in answer if key != "quaternion"}


@pytest.mark.parametrize(
    ("mistake", "planner"),
    [
        pytest.param(*pair, marks=[] if k % 2 else pytest.mark.thorough)
        for k, pair in enumerate(PAIRS)
    ],
)
def test_planted_mistakes_are_named_and_undone(
    mistake: str, planner: str, seen: CheckScene
) -> None:
    frames, right = Frames(seen), ASKED[planner](14)
    plant, words = PLANTED[mistake]
    answer = plant(right, frames)
    given = {key: value for key, value in answer.items() if key != "quaternion"}
    found = check_answers([given], seen)
    assert len(found.problems) == (2 if mistake == "z mirrored" else 1)
    text = " ".join(found.problems).replace("\n", " ")
    assert re.search(words, text), text
    after = corrected({k: v for k, v in answer.items() if k != "frame"}, found, seen)
    if "width" in after:
        assert after["width"] == pytest.approx(0.064)
    X_SM = {"X_CG": frames.X_SC, "X_WG": np.linalg.inv(frames.X_WS), "X_SG": np.eye(4)}
    ((entry, X),) = ((key, value) for key, value in after.items() if key in X_SM)
    shift = (0, 0, 0.1034) if mistake == "named acronym" else (0, 0, 0)
    X_SG = X_SM[entry] @ X @ pose(p=shift)
    off = [np.abs(X_SG - right @ swap).max(axis=(1, 2)) for swap in (np.eye(4), pose((0, 0, 180)))]
    assert np.minimum(*off).max() < 1e-5


def random_grasps(count: int, seed: int) -> Poses:
    """Random orientations at random places around the objects."""
    rng = np.random.default_rng(seed)
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = Rotation.random(count, random_state=seed).as_matrix()
    X[:, :3, 3] = np.where(rng.random((count, 1)) < 0.5, X_SBOX[:3, 3], X_SCAN[:3, 3])
    X[:, :3, 3] += rng.uniform((-0.05, -0.05, 0.0), (0.05, 0.05, 0.2), (count, 3))
    return X


def any_approach(count: int, seed: int) -> Poses:
    """The fingers close right, and the hand comes from anywhere, also through the table."""
    rng = np.random.default_rng(seed)
    turns = [pose((angle, 0, 0)) for angle in rng.uniform(0.0, 360.0, count)]
    return both(count, seed) @ np.array(turns)


def mostly_random(count: int, seed: int) -> Poses:
    X = random_grasps(count, seed)
    X[::6] = both(count, seed)[::6]
    return X


@pytest.mark.parametrize("planner", [random_grasps, any_approach, thorough(mostly_random)])
def test_poor_planners_have_no_mistake_in_frames(
    planner: Callable[[int, int], Poses], seen: CheckScene
) -> None:
    found = check_answers([{"X_SG": planner(24, 3)}], seen)
    assert found.problems == ()
    fitting = found.fits[0]
    assert fitting <= 9
    if fitting < 8:
        assert found.unclear[0].startswith(
            f"Cannot tell whether the frames are right: {fitting} of 24 grasps"
        )
        counts = [
            re.search(r"Of (\d+) grasps? of the \w+, (\d+) fit", s) for s in found.unclear[1:]
        ]
        assert sum(int(match[1]) for match in counts if match) == 24
        assert sum(int(match[2]) for match in counts if match) == fitting


def test_two_right_grasps_are_too_few(seen: CheckScene) -> None:
    found = check_answers([{"X_SG": from_above(2)}], seen)
    assert found.problems == () and found.fits == (2, 2)
    assert found.unclear == (
        "Only 2 of 2 grasps fit, too few to be sure that the frames are right.",
    )


def test_the_reasons_of_grasps_that_do_not_fit_are_counted(seen: CheckScene) -> None:
    above, across = (0, 0, -1), (1, 0, 0)
    X = [
        X_SBOX @ grasp((0.0, 0.0, 0.1), above, across),  # the palm is in the carton
        X_SBOX @ grasp((0.0, 0.0, 0.29), above, across),  # in the air above it
        X_SCAN @ grasp((0.03, 0.0, 0.09), above, (0, 1, 0)),  # beside the middle, on the curve
        grasp((0.52, 0.17, -0.05), above, (0, 1, 0)),  # in the table
    ]
    assert check_answers([{"X_SG": np.array(X)}], seen).unclear == (
        "Cannot tell whether the frames are right: 0 of 4 grasps fit as returned, and no usual"
        " mistake explains why.",
        "Of 2 grasps of the carton, 0 fit; the open hand collides with it at 1, nothing is between"
        " the pads at 1.",
        "Of 2 grasps of the can, 0 fit; the pads do not close on opposite sides at 1, the open hand"
        " collides with the table at 1.",
    )


def on_each_object(seen: CheckScene, turn: Poses) -> list[dict[str, Any]]:
    """For each image one grasp of the carton and one of the can from above, in the camera frame."""
    down = grasp((0, 0, 0), (0, 0, -1), (1, 0, 0)) @ turn
    return [
        {
            "X_CG": Frames(seen).X_CS
            @ [
                scene.X_SO(name) @ pose(p=(0, 0, height)) @ down
                for name, height in zip(scene.instances, (0.2, 0.092), strict=True)
            ]
        }
        for scene in seen.scenes
    ]


def test_one_grasp_for_each_object_is_enough_in_three_images(seen: CheckScene) -> None:
    found = check_answers(on_each_object(seen, np.eye(4)), seen)
    assert (found.fits, found.count, found.images) == ((6, 6), 6, 3)
    assert found.problems == () and found.unclear == ()


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        (pose((0, 0, 90)), "turned by 90 degrees about the approach"),
        thorough(pose((180, 0, 0)), "z points out of the scene"),
        thorough(pose(p=(0, 0, -0.1034)), "at the flange"),
    ],
)
def test_mistakes_show_in_three_images(turn: Poses, words: str, seen: CheckScene) -> None:
    (problem,) = check_answers(on_each_object(seen, turn), seen).problems
    assert words in problem


def test_answers_in_other_frames_than_the_first_are_left_out(seen: CheckScene) -> None:
    answers = [{"X_SG": from_above(4)}, {"X_WG": from_above(4)}]
    found = check_answers(answers, seen)
    assert found.fits == (4, 4)
    assert found.problems[0].startswith("Poses are in X_SG and X_WG, in different images;")


def test_copies_of_a_grasp_show_nothing_new(seen: CheckScene) -> None:
    found = check_answers([{"X_SG": np.repeat(from_above(1), 3, axis=0)}], seen)
    assert found.fits == (1, 1) and found.unclear


def test_answers_that_are_refused_are_problems(seen: CheckScene) -> None:
    X = from_above(8)
    found = check_answers([{"X_GS": X}], seen)
    assert found.problems == (
        "The answer has an unknown entry 'X_GS'; return the inverse of these poses, X_SG.",
    )
    found = check_answers([{"X_SG": pose(p=(0, 0, 50)) @ X}], seen)
    assert "8 of 8 grasps of X_SG are more than 1 m away" in found.problems[0]
    found = check_answers([{"X_SG": X, "score": np.full(8, np.nan)}], seen)
    assert "8 of 8 scores are NaN" in found.problems[0] and found.fits == (8, 8)
    assert check_answers([[]], seen).problems[0].startswith("The planner returned list")  # type: ignore[arg-type]
    found = check_answers([{"X_SG": np.empty((0, 4, 4)), "time": 0.5}], seen)
    assert found.problems[0].startswith("There are no grasps") and found.time == 0.5


def test_grasps_that_fit_either_way_do_not_hide_turned_ones(seen: CheckScene) -> None:
    turned = from_above(12) @ pose((0, 0, 90))
    found = check_answers([{"X_SG": turned}], seen)
    (problem,) = found.problems
    assert (
        problem.startswith("The grasps are")
        and "turned by 90 degrees about the approach" in problem
    )
    assert found.fits[0] == 6 and "6 of the 12 that were tried fit" in problem
    assert check_answers([{"X_SG": from_above(12)}], seen).problems == ()


def test_asking_tells_the_time_and_failures(
    seen: CheckScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.benchmark.planner_check.make_check_scene", lambda station: seen)
    counts: list[int] = []

    def answer(*asked: Any) -> dict[str, Any]:
        counts.append(9)
        return {"X_SG": from_above(9)}

    found = check_planner(answer)
    assert found.problems == () and 0.0 < found.time < 10.0
    assert len(counts) == found.images == 3
    found = check_planner(lambda *asked: {"X_SG": from_above(20)})
    assert found.images == 1

    def fail(*asked: Any) -> Any:
        raise PlannerError("planner mine: no answer within 3 s")

    assert check_planner(fail).problems == ("planner mine: no answer within 3 s.",)


def test_the_command_prints_problems(
    seen: CheckScene, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    X = from_above(20)

    class Planner:
        def __init__(self, reference: str) -> None:
            grasps = {"turned": X @ pose((180, 0, 0)), "right": X, "can alone": X[:1]}
            self.X = grasps[reference]

        def ask(self, *asked: Any) -> dict[str, Any]:
            self.X = self.X @ pose(p=(0.0, 0.0, 1e-4))  # no answer twice
            return {"X_SG": self.X, "time": 0.25}

    @contextlib.contextmanager
    def open_planner(reference: str, *, time_limit: float, **options: Any) -> Iterator[Planner]:
        assert time_limit == 7.0
        assert options == {"limit_source": "the limit of --time-limit", "show_output": True}
        yield Planner(reference)

    monkeypatch.setattr(benchmark, "open_planner", open_planner, raising=False)
    monkeypatch.setattr(benchmark, "check_planner", check_planner, raising=False)
    monkeypatch.setattr("burg_drake.benchmark.planner_check.make_check_scene", lambda station: seen)
    assert main(["planner", "check", "turned", "--time-limit", "7"]) == 1
    first, problem, line = capsys.readouterr().out.splitlines()
    assert first == "turned: 20 grasps in 1 image of a carton and a can, 250 ms in all"
    assert problem.startswith("problem: The grasps are turned around: z points out of the scene")
    assert line.startswith("    X_SG = X_SG @ np.array([[1, 0, 0, 0],")
    assert main(["planner", "check", "right", "--time-limit", "7"]) == 0
    out = capsys.readouterr().out
    assert "  20 of 20 fit as returned" in out and out.endswith("  no problem found\n")
    assert main(["planner", "check", "can alone", "--time-limit", "7"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "can alone: 3 grasps in 3 images of a carton and a can, 750 ms in all",
        "  3 of 3 fit as returned: the open hand is clear of the object, and its pads close on it",
        "  Cannot tell whether the frames are right: only grasps of the can fit, which also fit if"
        " they are turned about the approach.",
        "  No grasp is near the carton.",
    ]
