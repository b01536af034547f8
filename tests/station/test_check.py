"""Overlaps by closed form: boxes that stand into each other by a known amount."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import trimesh

from burg_drake.core import InvalidInputError, Pose, inverse
from burg_drake.objects import load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Instance, Scene, SceneDocument, SceneIssue, load_scene, save_scene
from burg_drake.station import (
    Obstacle,
    SceneCheck,
    Station,
    StationDocument,
    Table,
    build_station_diagram,
    check_scene,
    load_station,
    require_valid_scene,
)

EDGE = 0.06
HEIGHT = EDGE / 2
"""Of a cube's centre above the board [m]."""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("cubes")
    cube = ObjectSource(name="cube", mesh=trimesh.creation.box((EDGE, EDGE, EDGE)), mass=0.2)
    core = trimesh.creation.box((EDGE - 0.002, EDGE - 0.002, EDGE))
    padded = replace(cube, name="padded", pieces=(core,), contact="pieces")
    assert not build_library([cube, padded], out).failed
    return out


@pytest.fixture(scope="module")
def panda() -> Station:
    return load_station("panda_tabletop")


def bare_station(panda: Station, **changes: object) -> Station:
    """A table without an arm; the board lies at the world's origin."""
    document = StationDocument(name="bare", table=Table(size=(2.0, 2.0, 0.1)), **changes)  # type: ignore[arg-type]
    return Station(document, panda.hand, panda.hand_model, None, Path("bare.yaml"))


def scene_of(library: Path, folder: Path, *centres: tuple[float, float, float]) -> Scene:
    instances = tuple(
        Instance(name=f"cube_{i}", object="cube", X_SO=Pose(p)) for i, p in enumerate(centres)
    )
    document = SceneDocument(name="cubes", library=str(library), instances=instances)
    save_scene(document, folder / "scene.yaml")
    return load_scene(folder / "scene.yaml")


def only(issues: tuple[SceneIssue, ...]) -> SceneIssue:
    (issue,) = issues
    return issue


def test_two_boxes_that_overlap_by_3_mm(library: Path, panda: Station, tmp_path: Path) -> None:
    apart = scene_of(library, tmp_path, (0.2, 0.2, HEIGHT), (0.2 + EDGE + 1e-4, 0.2, HEIGHT))
    assert check_scene(apart, panda) == ()
    scene = scene_of(library, tmp_path, (0.2, 0.2, HEIGHT), (0.2 + EDGE - 0.003, 0.2, HEIGHT))
    issue = only(check_scene(scene, panda))
    assert (issue.instance, issue.kind) == ("cube_0", "overlap")
    assert issue.amount == pytest.approx(0.003, abs=1e-6)
    assert issue.message == "'cube_0' and 'cube_1' overlap by 3.0 mm; move them apart"


@pytest.mark.parametrize(("depth", "kind"), [(0.0009, ""), (0.0015, "surface_overlap")])
def test_surfaces_overlap_where_pieces_do_not(
    library: Path, panda: Station, depth: float, kind: str
) -> None:
    """The pieces stay 1 mm inside the cubes' sides, so that they are apart by 2 mm less `depth`."""
    instances = tuple(
        Instance(name=f"cube_{i}", object="padded", X_SO=Pose((x, 0.2, HEIGHT)))
        for i, x in enumerate((0.2, 0.2 + EDGE - depth))
    )
    document = SceneDocument(name="cubes", library=str(library), instances=instances)
    scene = Scene(document, load_library(library), library / "scene.yaml")
    assert SceneCheck(panda, scene.library).issues(scene) == ()
    issues = check_scene(scene, panda)
    assert [issue.kind for issue in issues] == [kind] * bool(kind)
    for issue in issues:
        assert (issue.instance, issue.other, issue.is_error) == ("cube_0", "cube_1", False)
        assert issue.amount == pytest.approx(depth, abs=1e-6)
        assert "surfaces of 'cube_0' and 'cube_1' overlap by 1.5 mm" in issue.message


def test_touching_by_less_than_a_millimetre_is_fine(
    library: Path, panda: Station, tmp_path: Path
) -> None:
    scene = scene_of(library, tmp_path, (0.2, 0.2, HEIGHT), (0.2, 0.2 + EDGE - 9e-4, HEIGHT))
    assert check_scene(scene, panda) == ()


def test_obstacle_of_the_station(library: Path, panda: Station, tmp_path: Path) -> None:
    wall = Obstacle(X_WB=Pose((0.25, 0.2, 0.1)), size=(0.02, 0.3, 0.2))
    scene = scene_of(library, tmp_path, (0.215, 0.2, HEIGHT))
    issue = only(check_scene(scene, bare_station(panda, background={"wall": wall})))
    assert issue.message == "'cube_0' and 'wall' overlap by 5.0 mm; move them apart"


def test_what_leans_on_a_box_of_the_station_may_sink_into_it_as_into_the_table(
    library: Path, panda: Station, tmp_path: Path
) -> None:
    scene = scene_of(library, tmp_path, (0.215, 0.2, HEIGHT))
    said = {
        0.9e-3: [],
        2.4e-3: ["'cube_0' is 2.4 mm deep in 'wall'; move it, unless it leans there"],
        2.6e-3: ["'cube_0' and 'wall' overlap by 2.6 mm; move them apart"],
    }
    for depth, messages in said.items():
        wall = Obstacle(X_WB=Pose((0.255 - depth, 0.2, 0.1)), size=(0.02, 0.3, 0.2))
        issues = check_scene(scene, bare_station(panda, background={"wall": wall}))
        assert [issue.message for issue in issues] == messages
        assert [issue.is_error for issue in issues] == [depth > 2.5e-3] * len(messages)


def test_buried_is_said_once(library: Path, panda: Station, tmp_path: Path) -> None:
    issue = only(check_scene(scene_of(library, tmp_path, (0.2, 0.2, HEIGHT - 0.01)), panda))
    assert issue.kind == "in_ground"


def test_board_below_the_table_top(library: Path, panda: Station, tmp_path: Path) -> None:
    sunk = bare_station(panda, X_WS=Pose((0.0, 0.0, -0.004)))
    issue = only(check_scene(scene_of(library, tmp_path, (0.2, 0.2, HEIGHT)), sunk))
    assert issue.message == "'cube_0' and 'table' overlap by 4.0 mm; move them apart"


def test_beside_the_table(library: Path, panda: Station, tmp_path: Path) -> None:
    moved = bare_station(panda, X_WS=Pose((0.85, 0.0, 0.0)))
    issue = only(check_scene(scene_of(library, tmp_path, (0.2, 0.2, HEIGHT)), moved))
    assert issue.kind == "out_of_bounds"
    assert issue.amount == pytest.approx(0.05)
    assert "is 50.0 mm off the table of station 'bare'" in issue.message


def test_the_arm_at_home_is_in_the_way(library: Path, panda: Station, tmp_path: Path) -> None:
    # The arm's base is at the world's origin, behind the board's lower edge: out of bounds, too.
    x, y = panda.document.X_WS.translation[1], -panda.document.X_WS.translation[0]
    issues = check_scene(scene_of(library, tmp_path, (x, y, HEIGHT)), panda)
    assert {issue.kind for issue in issues} == {"out_of_bounds", "overlap"}
    (message,) = (i.message for i in issues if i.kind == "overlap" and "panda_link0" in i.message)
    assert message.startswith("'cube_0' overlaps 'panda_link0' where the arm stands by ")
    assert message.endswith(f" mm; move 'cube_0', or change arm.X_WA in {panda.path}")


def test_the_arm_at_home_is_said_to_be(library: Path, panda: Station, tmp_path: Path) -> None:
    """A cube that floats in the hand."""
    scene = scene_of(library, tmp_path, (0.2, 0.2, HEIGHT))
    built = build_station_diagram(scene, panda, robot="arm")
    context = built.plant.CreateDefaultContext()
    X_WH = built.plant.GetBodyByName(panda.hand.body).EvalPoseInWorld(context).GetAsMatrix4()
    p_SH = (inverse(panda.document.X_WS.matrix()) @ X_WH)[:3, 3]
    issues = check_scene(scene_of(library, tmp_path, tuple(p_SH.tolist())), panda)
    messages = {i.message.split("'")[3]: i.message for i in issues if i.kind == "overlap"}
    assert set(messages) == {"panda_hand", "panda_link7"}
    for link, message in messages.items():
        start, _, end = message.partition(" mm; ")
        assert start.startswith(f"'cube_0' overlaps '{link}' of the arm in its home posture by ")
        assert end == f"move 'cube_0', or change arm.home in {panda.path}"


def test_require_valid_scene(library: Path, panda: Station, tmp_path: Path) -> None:
    require_valid_scene(scene_of(library, tmp_path, (0.2, 0.2, HEIGHT)), panda)
    overlapping = scene_of(library, tmp_path, (0.2, 0.2, HEIGHT), (0.2, 0.21, HEIGHT))
    with pytest.raises(
        InvalidInputError, match=r"scene\.yaml: 'cube_0' and 'cube_1' overlap by 50"
    ):
        require_valid_scene(overlapping, panda)


def test_what_was_sound_is_looked_at_again_once_a_model_was_edited(
    library: Path, panda: Station, tmp_path: Path
) -> None:
    edited = tmp_path / "library"
    shutil.copytree(library, edited)
    places = (0.2, 0.2, HEIGHT), (0.2 + EDGE + 1e-4, 0.2, HEIGHT)
    require_valid_scene(scene_of(edited, tmp_path, *places), panda)
    (model,) = edited.rglob("cube.sdf")
    text = model.read_text()
    before, wider = (
        f"<size>{EDGE} {EDGE} {EDGE}</size>",
        f"<size>{EDGE + 0.01} {EDGE} {EDGE}</size>",
    )
    assert before in text
    model.write_text(text.replace(before, wider))
    with pytest.raises(InvalidInputError, match="'cube_0' and 'cube_1' overlap by 9"):
        require_valid_scene(scene_of(edited, tmp_path, *places), panda)


@pytest.mark.parametrize(
    "depth, kinds", [(0.0045, ["sunken"]), (0.0052, ["in_ground"])], ids=["borne", "pressed in"]
)
def test_what_stands_on_a_tip_sinks_into_the_table(
    library: Path, panda: Station, tmp_path: Path, depth: float, kinds: list[str]
) -> None:
    """A corner of a cube has the volume sqrt(3) d^3 / 2; times the modulus 1e6 Pa, over half the
    table's thickness of 0.1 m, it bears 0.2 kg at d = 4.8 mm."""
    on_corner = Pose((0.2, 0.2, 3**0.5 * EDGE / 2 - depth), rpy_deg=(45.0, 35.2644, 0.0))
    tip = Instance(name="tip", object="cube", X_SO=on_corner)
    document = SceneDocument(name="tip", library=str(library), instances=(tip,))
    save_scene(document, tmp_path / "scene.yaml")
    issues = check_scene(load_scene(tmp_path / "scene.yaml"), bare_station(panda))
    assert [issue.kind for issue in issues] == kinds


def test_only_what_touches_no_other_is_to_be_lifted_out_of_the_table(
    library: Path, panda: Station, tmp_path: Path
) -> None:
    """A cube that stands 1.2 mm deep, alone; then with another one on it."""
    alone, below = (0.3, 0.3, HEIGHT - 1.2e-3), (0.1, 0.1, HEIGHT - 1.2e-3)
    on_top = (0.1, 0.1, HEIGHT + EDGE - 1.2e-3)
    issues = check_scene(scene_of(library, tmp_path, alone, below, on_top), bare_station(panda))
    assert [(issue.instance, issue.kind) for issue in issues] == [("cube_0", "sunken")]


def test_what_is_placed_flat_in_the_table_is_refused(
    library: Path, panda: Station, tmp_path: Path
) -> None:
    flat = scene_of(library, tmp_path, (0.2, 0.2, HEIGHT - 0.003))
    assert only(check_scene(flat, bare_station(panda))).kind == "in_ground"
