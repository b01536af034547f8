"""What takes a scene or a station takes it loaded or by name, and makes the same of both."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import burg_drake as burg
from burg_drake.cameras import (
    BoardEstimate,
    FrameProcessor,
    Intrinsics,
    Overlay,
    SceneOverlay,
    build_board_loop,
    check_placement,
    instance_labels,
    locate_camera,
    open_source,
    visible_from,
)
from burg_drake.compose import ComposeSession
from burg_drake.core import BurgError, GraspSet
from burg_drake.evaluation import (
    clear_grasp_counts,
    count_grasps,
    read_grasps,
    sample_grasps,
    scored_set,
    within_reach,
)
from burg_drake.export import export_scene
from burg_drake.formats import write_grasp_file
from burg_drake.generation import sample_scene, sample_scenes
from burg_drake.grasping import hand_clearance_alone
from burg_drake.motion import (
    ArmKinematics,
    ArmReach,
    ArmSpan,
    Plan,
    ReachabilitySettings,
    inspect_station,
    load_plan,
    map_reachability,
    plan,
    reach_from_above,
)
from burg_drake.objects import load_library
from burg_drake.printout import height_map, print_board
from burg_drake.scene import Scene, SceneLike, SceneRecipe, as_scene, load_scene, validate_scene
from burg_drake.simulation import ArmTrial, HandTrial, measure_drift, settle_scene
from burg_drake.station import (
    SceneCheck,
    Station,
    StationLike,
    as_station,
    build_station_diagram,
    check_scene,
    load_station,
)

STATION = "panda_tabletop"
X_OG = np.diag([1.0, -1.0, -1.0, 1.0])
X_OG[2, 3] = 0.19
"""The box from above, across its narrow side; its frame is at the middle of its bottom."""
INTRINSICS = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
SEEN = BoardEstimate(
    X_SC=np.array(
        [[1.0, 0.0, 0.0, 0.15], [0.0, -1.0, 0.0, 0.1], [0.0, 0.0, -1.0, 0.5], [0.0, 0.0, 0.0, 1.0]]
    ),
    valid=True,
)
IMAGE = np.full((240, 320, 3), 127, np.uint8)
SCENE = """version: 1
name: one_box
library: household
board: {size: [0.297, 0.210], markers: {side: 0.03, spacing: 0.01}}
instances:
  - {object: box, X_SO: {translation: [0.15, 0.10, 0.0]}}
"""


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("by_name") / "one_box.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def contents(built: Any) -> tuple[str, str]:
    """What a station diagram was built of."""
    return built.scene.content, built.station.content


def grasps_of(grasps: GraspSet) -> tuple[list[Any], ...]:
    return grasps.id.tolist(), grasps.X_OG.tolist(), grasps.width.tolist()


def grasp_file(folder: Path) -> Path:
    path = folder / "grasps.h5"
    grasps = GraspSet.create(X_OG, width=0.05, object="box")
    write_grasp_file(grasps, path)
    return path


def read(scene: SceneLike, folder: Path) -> Any:
    return grasps_of(read_grasps(scene, grasp_file(folder)).by_instance["box"])


def scored(scene: SceneLike, station: StationLike) -> Any:
    grasps = GraspSet.create(X_OG, width=0.05, object="box")
    found = scored_set(grasps, load_library("household"), station, scene)
    return found.column("clearance").tolist(), found.column("screened").tolist()


def simulated_camera(scene: SceneLike) -> Any:
    with open_source(f"sim:{STATION}/board", scene=scene, size=None) as source:
        frame = source.read()
        assert frame is not None
        return frame.image.tobytes()


def placement(scene: SceneLike) -> Any:
    found = check_placement(scene, IMAGE, INTRINSICS, estimate=SEEN)
    return found.scene, found.instances


def drawn(overlay: type) -> Callable[[SceneLike], Any]:
    def draw(scene: SceneLike) -> Any:
        return overlay(scene, INTRINSICS).draw(IMAGE, SEEN.X_SC).tobytes()

    return draw


def overlaid(scene: SceneLike) -> Any:
    system = SceneOverlay(scene, INTRINSICS)
    return [system.get_input_port(i).get_name() for i in range(system.num_input_ports())]


def checked(scene: SceneLike, station: StationLike) -> Any:
    """With the library of the scene as it was loaded before, as a page has it."""
    check = SceneCheck(station, load_library("household"))
    return check.issues(scene), check.travel(scene, ["box"], [1.0, 0.0, 0.0], 0.05)


def sampled(station: StationLike) -> Any:
    recipe = SceneRecipe(library="household", count=1, only=("box",), settle=False)
    return sample_scene(recipe, station=station).scene.content


def sampled_folder(station: StationLike, folder: Path) -> Any:
    recipe = SceneRecipe(library="household", count=1, only=("box",), settle=False)
    found = sample_scenes(recipe, load_library("household"), station, folder, 1)
    return found.rows


def exported(scene: SceneLike, station: StationLike, folder: Path) -> Any:
    main = export_scene(scene, folder / "world", "sdf", station).main
    return main.read_text(encoding="utf-8")


def refused(plan: Plan, scene: SceneLike, station: StationLike) -> str:
    with pytest.raises(BurgError) as error:
        plan.require_for(scene, station)
    return str(error.value)


def planned(scene: SceneLike, station: StationLike, folder: Path) -> Any:
    """Motion of a plan, written and read again for the same scene."""
    found = plan(scene, station, "box", X_OG)
    assert isinstance(found, Plan)
    path = folder / "plan.json"
    found.to_json(path)
    assert refused(found, "tabletop_six", station) == refused(
        found, load_scene("tabletop_six"), station
    )
    return load_plan(path, scene=scene, station=station).lift.q.tolist()


def reached(scene: SceneLike, station: StationLike) -> Any:
    X_WO = (
        as_station(station).document.X_WS.matrix() @ as_scene(scene).instance("box").X_SO.matrix()
    )
    found = ArmReach(scene, station).check("box", X_WO @ X_OG)
    return found.outcome, found.clearance


def composed(station: StationLike, folder: Path) -> Any:
    with ComposeSession.open("tabletop_six", station, folder=folder) as session:
        return session.station.content, session.view.issues


def located(station: StationLike) -> Any:
    return locate_camera(station, [SEEN], INTRINSICS).X_WC.tolist()


def spanned(station: StationLike) -> Any:
    diagram = build_station_diagram("tabletop_six", station, robot="arm", weld_objects=True)
    span = ArmSpan.of(ArmKinematics.of(diagram), station)
    return span.p_WJ.tolist(), span.radius


def mapped(scene: SceneLike, station: StationLike) -> Any:
    settings = ReachabilitySettings(spacing=0.1, heights=(0.1,), tilts_deg=(0.0,), headings=(1,))
    reached = map_reachability(scene, station, settings=settings).reached.tolist()
    report = inspect_station(station, scene, settings=settings)
    return reached, report.warnings, report.seen


Answer = Callable[[SceneLike, StationLike, Path], Any]
ANSWERS: dict[str, Answer] = {
    "validate_scene": lambda scene, station, folder: validate_scene(scene),
    "check_scene": lambda scene, station, folder: check_scene(scene, station),
    "SceneCheck": lambda scene, station, folder: checked(scene, station),
    "print_board": lambda scene, station, folder: print_board(scene).tiling,
    "height_map": lambda scene, station, folder: height_map(scene, 0.005).height.tobytes(),
    "measure_drift": lambda scene, station, folder: measure_drift(scene, station, duration=0.01),
    "FrameProcessor": lambda scene, station, folder: (
        FrameProcessor(scene, INTRINSICS).scene.content
    ),
    "ComposeSession": lambda scene, station, folder: composed(station, folder),
    "build_station_diagram": lambda scene, station, folder: contents(
        build_station_diagram(scene, station)
    ),
    "build_board_loop": lambda scene, station, folder: contents(
        build_board_loop(scene, station).built
    ),
    "export_scene": exported,
    "HandTrial": lambda scene, station, folder: contents(HandTrial(scene, station).diagram),
    "ArmTrial": lambda scene, station, folder: contents(ArmTrial(scene, station).diagram),
    "ArmReach": lambda scene, station, folder: reached(scene, station),
    "plan": planned,
    "sample_grasps": lambda scene, station, folder: grasps_of(sample_grasps(scene, station, 3)),
    "count_grasps": lambda scene, station, folder: count_grasps(
        scene, station, grasps_per_object=2
    ),
    "clear_grasp_counts": lambda scene, station, folder: clear_grasp_counts(
        scene, station, grasps_per_object=2
    ),
    "within_reach": lambda scene, station, folder: within_reach(scene, station),
    "read_grasps": lambda scene, station, folder: read(scene, folder),
    "scored_set": lambda scene, station, folder: scored(scene, station),
    "hand_clearance_alone": lambda scene, station, folder: contents(
        hand_clearance_alone(load_library("household"), "box", station)._station_diagram
    ),
    "settle_scene": lambda scene, station, folder: settle_scene(scene, station).scene.content,
    "sample_scene": lambda scene, station, folder: sampled(station),
    "sample_scenes": lambda scene, station, folder: sampled_folder(station, folder / "scenes"),
    "visible_from": lambda scene, station, folder: visible_from(scene, station, "board"),
    "locate_camera": lambda scene, station, folder: located(station),
    "open_source": lambda scene, station, folder: simulated_camera(scene),
    "check_placement": lambda scene, station, folder: placement(scene),
    "instance_labels": lambda scene, station, folder: instance_labels(
        scene, INTRINSICS, SEEN.X_SC
    ).tobytes(),
    "Overlay": lambda scene, station, folder: drawn(Overlay)(scene),
    "SceneOverlay": lambda scene, station, folder: overlaid(scene),
    "ArmSpan": lambda scene, station, folder: spanned(station),
    "map_reachability": lambda scene, station, folder: mapped(scene, station),
    "reach_from_above": lambda scene, station, folder: reach_from_above(
        station, spacing=0.1
    ).reached.tolist(),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_the_same_loaded_and_by_name(name: str, scene_file: Path, tmp_path: Path) -> None:
    loaded, by_name = tmp_path / "loaded", tmp_path / "by_name"
    loaded.mkdir(), by_name.mkdir()
    first = ANSWERS[name](load_scene(scene_file), load_station(STATION), loaded)
    assert ANSWERS[name](str(scene_file), STATION, by_name) == first


def test_what_is_loaded_is_taken_as_it_is(scene_file: Path) -> None:
    scene, station = load_scene(scene_file), load_station(STATION)
    assert as_scene(scene) is scene
    assert as_station(station) is station
    assert as_scene("tabletop_six").name == "tabletop_six"
    assert as_scene(scene_file).content == scene.content
    assert as_station(STATION).content == station.content


def public() -> Iterator[tuple[str, Any]]:
    """All that the package and its faces show, once each."""
    todo, seen = [(burg.__name__, burg)], set()
    while todo:
        where, module = todo.pop()
        for name in dir(module):
            one = getattr(module, name)
            if name.startswith("_") or id(one) in seen:
                continue
            seen.add(id(one))
            if isinstance(one, ModuleType):
                if one.__name__.startswith("burg_drake."):
                    todo.append((f"{where}.{name}", one))
            elif getattr(one, "__module__", "").startswith("burg_drake."):
                yield f"{where}.{name}", one


def signatures() -> Iterator[tuple[str, Any]]:
    for name, one in public():
        if inspect.isfunction(one):
            yield name, one
        elif inspect.isclass(one):
            for method, function in inspect.getmembers(one, inspect.isroutine):
                function = getattr(function, "__func__", function)
                if not inspect.isfunction(function):
                    continue
                made = method == "__init__" and dataclasses.is_dataclass(one)
                if not made and (method == "__init__" or not method.startswith("_")):
                    yield f"{name}.{method}", function


def test_no_public_signature_asks_for_a_loaded_one() -> None:
    loaded = re.compile(rf"\b({Scene.__name__}|{Station.__name__})\b")
    asked = [
        f"{name}({argument}: {annotation})"
        for name, function in signatures()
        for argument, annotation in function.__annotations__.items()
        if argument != "return" and loaded.search(str(annotation))
    ]
    assert asked == []
