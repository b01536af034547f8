"""The diagram builder: ports, default context, names, locks, and statics of what it contains."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactResults
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from burg_drake.core import InvalidInputError, Pose, UnknownNameError
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene, save_scene
from burg_drake.station import (
    MODEL_NAMES,
    Obstacle,
    Station,
    StationDiagram,
    build_station_diagram,
    load_station,
)

GRAVITY = 9.81
HOME = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
INSTANCES = (
    Instance(name="box", object="box", X_SO=Pose((0.12, 0.2, 0.0), rpy_deg=(0.0, 0.0, 20.0))),
    Instance(name="can_left", object="can", X_SO=Pose((0.3, 0.2, 0.0))),
    Instance(name="can_right", object="can", X_SO=Pose((0.45, 0.2, 0.0))),
)


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def make_scene() -> Callable[..., Scene]:
    built_in = load_scene("tabletop_six")

    def make(*instances: Instance, background: tuple[Instance, ...] = ()) -> Scene:
        document = SceneDocument(
            name="three", library="household", instances=instances, background=background
        )
        return Scene(document, built_in.library, Path("three.yaml"))

    return make


@pytest.fixture(scope="module")
def scene(make_scene: Callable[..., Scene]) -> Scene:
    return make_scene(*INSTANCES)


@pytest.fixture(scope="module")
def built(scene: Scene, station: Station) -> dict[str, StationDiagram]:
    return {r: build_station_diagram(scene, station, robot=r) for r in ("arm", "hand", "none")}  # type: ignore[arg-type]


def plant_context(built: StationDiagram, context: Context) -> Context:
    return built.plant.GetMyMutableContextFromRoot(context)


def hold_still(built: StationDiagram, context: Context) -> None:
    """Commands the robot to stay where it is."""
    for i in range(built.diagram.num_input_ports()):
        port = built.diagram.get_input_port(i)
        if not port.get_name().endswith(".desired_state"):
            continue
        model = built.plant.GetModelInstanceByName(port.get_name().split(".")[0])
        state = built.plant.GetPositionsAndVelocities(plant_context(built, context), model)
        port.FixValue(context, state)


@pytest.mark.parametrize(
    ("robot", "models"), [("arm", ["hand", "arm"]), ("hand", ["hand", "lift"]), ("none", [])]
)
def test_ports(built: dict[str, StationDiagram], robot: str, models: list[str]) -> None:
    diagram = built[robot].diagram
    inputs = [diagram.get_input_port(i).get_name() for i in range(diagram.num_input_ports())]
    outputs = [diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())]
    of_models = [f"{model}.{name}" for model in models for name in ("desired_state", "feedforward")]
    assert inputs == [*of_models, "applied_forces"]
    assert outputs == [
        *(f"{model}.{name}" for model in models for name in ("state", "actuation")),
        *("state", "contact_results", "body_poses", "geometry_query"),
    ]
    context = diagram.CreateDefaultContext()
    for port in outputs:
        diagram.GetOutputPort(port).Eval(context)


def test_ports_with_drivers(scene: Scene, station: Station) -> None:
    """Those without drivers, and more; all can be read before anything is connected."""
    diagram = build_station_diagram(scene, station, drivers=True).diagram
    inputs = {diagram.get_input_port(i).get_name() for i in range(diagram.num_input_ports())}
    outputs = {diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())}
    assert inputs == {
        *(f"arm.{name}" for name in ("position", "desired_state", "feedforward")),
        *(f"hand.{name}" for name in ("position", "force_limit", "desired_state", "feedforward")),
        *("plan", "plan.start_time", "applied_forces"),
    }
    assert outputs == {
        *(f"arm.{name}" for name in ("state", "actuation", "position_commanded")),
        *(f"arm.{name}" for name in ("position_measured", "velocity_estimated", "estimated_state")),
        *(f"arm.{name}" for name in ("torque_commanded", "torque_measured", "external_torque")),
        *(f"hand.{name}" for name in ("state", "actuation", "state_measured", "force_measured")),
        *("wrist.force_torque", "reaction_forces"),
        *("state", "contact_results", "body_poses", "geometry_query"),
    }
    context = diagram.CreateDefaultContext()
    for port in outputs:
        diagram.GetOutputPort(port).Eval(context)


@pytest.mark.parametrize("robot", ["arm", "hand", "none"])
def test_objects_stand_where_the_documents_place_them(
    built: dict[str, StationDiagram], robot: str, scene: Scene, station: Station
) -> None:
    """Seen from the arm, x of S is to the right and y away from it."""
    plant = built[robot].plant
    context = plant_context(built[robot], built[robot].diagram.CreateDefaultContext())
    assert list(built[robot].free) == ["box", "can_left", "can_right"]
    for instance in INSTANCES:
        body = plant.get_body(built[robot].free[instance.name])
        x, y, z = instance.X_SO.translation
        X_WO = plant.EvalBodyPoseInWorld(context, body)
        np.testing.assert_allclose(X_WO.translation(), (0.24 + y, 0.297 - x, z), atol=1e-12)
        np.testing.assert_allclose(X_WO.GetAsMatrix4(), built[robot].X_WO(instance.name))


def test_two_instances_of_one_object_are_two_bodies(built: dict[str, StationDiagram]) -> None:
    plant, free = built["none"].plant, built["none"].free
    assert len(set(free.values())) == 3
    models = [plant.get_body(free[n]).model_instance() for n in ("can_left", "can_right")]
    assert [plant.GetModelInstanceName(m) for m in models] == ["can_left", "can_right"]


def test_arm_at_home_with_an_open_hand(built: dict[str, StationDiagram], station: Station) -> None:
    arm = built["arm"]
    context = arm.diagram.CreateDefaultContext()
    state = arm.diagram.GetOutputPort("arm.state").Eval(context)
    np.testing.assert_allclose(state, [*HOME, *np.zeros(7)], atol=1e-9)
    np.testing.assert_allclose(
        arm.diagram.GetOutputPort("hand.state").Eval(context), [0.04, 0.04, 0, 0]
    )
    assert [joint.name() for joint in arm.arm_joints] == [f"panda_joint{i}" for i in range(1, 8)]
    # The arm is in the plane y = 0: the upper arm leans back by 45 degrees, the forearm is level,
    # the hand points down. Lengths and the elbow's two offsets of 82.5 mm add up.
    s = np.sqrt(0.5)
    x = -0.316 * s + 0.0825 * s + 0.384 + 0.088
    z = 0.333 + 0.316 * s + 0.0825 * s + 0.0825 - 0.107
    hand = arm.plant.GetBodyByName("panda_hand")
    X_WH = arm.plant.EvalBodyPoseInWorld(plant_context(arm, context), hand)
    np.testing.assert_allclose(X_WH.translation(), (x, 0.0, z), atol=1e-9)
    np.testing.assert_allclose(X_WH.rotation().matrix()[:, 2], (0, 0, -1), atol=1e-9)


def test_floating_hand_waits_above_the_board(built: dict[str, StationDiagram]) -> None:
    hand = built["hand"]
    context = plant_context(hand, hand.diagram.CreateDefaultContext())
    X_WH = hand.plant.EvalBodyPoseInWorld(context, hand.plant.GetBodyByName("panda_hand"))
    assert X_WH.translation()[2] > 0.5
    np.testing.assert_allclose(X_WH.rotation().matrix()[:, 2], (0, 0, -1), atol=1e-12)
    lift = hand.plant.GetJointByName("lift")
    lift.set_translation(context, 0.1)
    raised = hand.plant.EvalBodyPoseInWorld(context, hand.plant.GetBodyByName("panda_hand"))
    np.testing.assert_allclose(raised.translation() - X_WH.translation(), (0, 0, 0.1), atol=1e-12)


def test_nothing_overlaps_at_the_start(built: dict[str, StationDiagram]) -> None:
    for diagram in (b.diagram for b in built.values()):
        query = diagram.GetOutputPort("geometry_query").Eval(diagram.CreateDefaultContext())
        assert [p.depth for p in query.ComputePointPairPenetration() if p.depth > 1e-6] == []


def test_body_names(built: dict[str, StationDiagram]) -> None:
    names = set(built["arm"].body_names.values())
    assert {"box", "can_left", "can_right", "table", "panda_link0", "panda_hand"} <= names
    assert "body" not in names


@pytest.mark.parametrize("robot", ["arm", "hand"])
def test_the_robot_stays_where_it_is_told_to(built: dict[str, StationDiagram], robot: str) -> None:
    """Gravity does not pull it, and what stands on the table stays there."""
    simulated = built[robot]
    context = simulated.diagram.CreateDefaultContext()
    hold_still(simulated, context)
    before = simulated.plant.GetPositions(plant_context(simulated, context)).copy()
    Simulator(simulated.diagram, context).AdvanceTo(0.3)
    after = simulated.plant.GetPositions(plant_context(simulated, context))
    np.testing.assert_allclose(after, before, atol=1e-4)


def test_the_table_carries_the_weight(built: dict[str, StationDiagram], scene: Scene) -> None:
    simulated = built["none"]
    context = simulated.diagram.CreateDefaultContext()
    Simulator(simulated.diagram, context).AdvanceTo(0.5)
    results: ContactResults = simulated.diagram.GetOutputPort("contact_results").Eval(context)
    assert results.num_point_pair_contacts() == 0
    force = np.zeros(3)
    for i in range(results.num_hydroelastic_contacts()):
        on_a = results.hydroelastic_contact_info(i).F_Ac_W().translational()
        force += on_a * np.sign(on_a[2])
    weight = GRAVITY * sum(scene.entry(name).mass for name in scene.instances)
    assert force[2] == pytest.approx(weight, rel=0.01)


def test_free_objects_can_be_locked(built: dict[str, StationDiagram]) -> None:
    simulated = built["none"]
    context = simulated.diagram.CreateDefaultContext()
    plant = simulated.plant
    for name in ("box", "can_left"):
        model = plant.GetModelInstanceByName(name)
        for joint in plant.GetJointIndices(model):
            plant.get_joint(joint).Lock(plant_context(simulated, context))
    lifted = RigidTransform([0.5, 0.0, 0.3])
    can = plant.get_body(simulated.free["can_right"])
    plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context(simulated, context), can, lifted)
    Simulator(simulated.diagram, context).AdvanceTo(0.1)
    fallen = plant.EvalBodyPoseInWorld(plant_context(simulated, context), can).translation()
    assert fallen[2] == pytest.approx(0.3 - GRAVITY * 0.1**2 / 2, abs=2e-3)
    still = plant.get_body(simulated.free["box"])
    X_WO = plant.EvalBodyPoseInWorld(plant_context(simulated, context), still)
    np.testing.assert_allclose(X_WO.GetAsMatrix4(), simulated.X_WO("box"), atol=1e-12)


def test_part_of_a_diagram_of_ones_own(scene: Scene, station: Station) -> None:
    """The ports are wired by name; the fingers follow their command."""
    built = build_station_diagram(scene, station)
    builder = DiagramBuilder()
    part = builder.AddNamedSystem("station", built.diagram)
    for port, value in (
        ("arm.desired_state", [*HOME, *np.zeros(7)]),
        ("hand.desired_state", [0.0, 0.0, -0.05, -0.05]),
    ):
        source = builder.AddSystem(ConstantVectorSource(value))
        builder.Connect(source.get_output_port(), part.GetInputPort(port))
    builder.ExportOutput(part.GetOutputPort("hand.state"), "hand")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.4)
    hand = diagram.GetOutputPort("hand").Eval(simulator.get_context())
    np.testing.assert_allclose(hand[:2], 0.04 - 0.4 * 0.05, atol=1e-3)


def test_background_objects_and_obstacles_do_not_move(
    make_scene: Callable[..., Scene], station: Station
) -> None:
    floating = Instance(name="shelf_can", object="can", X_SO=Pose((0.3, 0.2, 0.4)))
    wall = Obstacle(X_WB=Pose((0.8, 0.0, 0.2)), size=(0.02, 0.8, 0.4))
    walled = replace(station, document=replace(station.document, background={"wall": wall}))
    built = build_station_diagram(make_scene(background=(floating,)), walled, robot="none")
    assert built.free == {} and set(built.fixed) == {"shelf_can", "wall"}
    context = built.diagram.CreateDefaultContext()
    Simulator(built.diagram, context).AdvanceTo(0.1)
    assert built.plant.num_positions() == 0
    for name, p_WB in (("shelf_can", (0.44, -0.003, 0.4)), ("wall", (0.8, 0.0, 0.2))):
        X_WB = built.plant.EvalBodyPoseInWorld(
            plant_context(built, context), built.plant.get_body(built.fixed[name])
        )
        np.testing.assert_allclose(X_WB.translation(), p_WB, atol=1e-12)


@pytest.mark.parametrize("name", MODEL_NAMES)
@pytest.mark.parametrize("robot", ["arm", "none"])
def test_instance_named_like_a_part_of_the_station(
    make_scene: Callable[..., Scene], station: Station, name: str, robot: str
) -> None:
    taken = make_scene(Instance(name=name, object="can"))
    with pytest.raises(
        InvalidInputError,
        match=rf"three.yaml: .*'{name}' already",
    ):
        build_station_diagram(taken, station, robot=robot)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["can_left", "table", "arm"])
def test_obstacle_named_like_something_else(scene: Scene, station: Station, name: str) -> None:
    box = Obstacle(X_WB=Pose((0.8, 0.0, 0.2)), size=(0.02, 0.8, 0.4))
    changed = replace(station, document=replace(station.document, background={name: box}))
    with pytest.raises(InvalidInputError, match=rf"panda_tabletop.yaml: background.{name}:"):
        build_station_diagram(scene, changed, robot="none")


def test_instances_named_like_links_and_models(
    make_scene: Callable[..., Scene], station: Station
) -> None:
    """Names of model instances are all that has to be unique."""
    names = ["body", "panda_hand", "panda_link5", "mug"]
    instances = [
        Instance(name=n, object="can", X_SO=Pose((0.1 + 0.1 * i, 0.2, 0.0)))
        for i, n in enumerate(names)
    ]
    mug = Instance(name="can", object="mug", X_SO=Pose((0.3, 0.35, 0.0)))
    built = build_station_diagram(make_scene(*instances, mug), station)
    assert list(built.free) == [*names, "can"]


@pytest.mark.parametrize(
    ("home", "message"),
    [
        (HOME[:6], "arm.home has 6 joint angles; the arm has 7 joints"),
        (
            (*HOME[:3], 0.5, *HOME[4:]),
            "arm.home puts panda_joint4 at 0.5 rad; its range is -3.0718",
        ),
    ],
)
def test_home_that_does_not_fit(
    scene: Scene, station: Station, home: tuple[float, ...], message: str
) -> None:
    assert station.document.arm is not None
    arm = replace(station.document.arm, home=home)
    changed = replace(station, document=replace(station.document, arm=arm))
    with pytest.raises(InvalidInputError, match=message):
        build_station_diagram(scene, changed)


def test_no_arm(scene: Scene, station: Station) -> None:
    changed = replace(station, document=replace(station.document, arm=None))
    with pytest.raises(InvalidInputError, match=r"'panda_tabletop' .* has no arm"):
        build_station_diagram(scene, changed)
    assert build_station_diagram(scene, changed, robot="hand").robot == "hand"


def test_models_of_drake_are_not_fetched(
    scene: Scene, station: Station, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A model that refers to the package drake_models fails at once, without the network."""
    text = station.hand_model.read_text(encoding="utf-8")
    text = text.replace("meshes/hand.obj", "package://drake_models/ycb/meshes/004_sugar_box.obj")
    (tmp_path / "hand.sdf").write_text(text, encoding="utf-8")
    changed = replace(station, hand_model=tmp_path / "hand.sdf")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(UnknownNameError, match=r"package 'drake_models' is not found in .* cache"):
        build_station_diagram(scene, changed, robot="hand")


def test_meshcat_shows_the_instances(scene: Scene, station: Station) -> None:
    meshcat = Meshcat()
    built = build_station_diagram(scene, station, meshcat=meshcat)
    built.diagram.ForcedPublish(built.diagram.CreateDefaultContext())
    for name in ("box", "can_left", "can_right", "table", "board", "arm", "hand"):
        assert meshcat.HasPath(f"/drake/visualizer/{name}"), name


def test_unknown_robot_and_incomplete_library(tmp_path: Path) -> None:
    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    with pytest.raises(UnknownNameError, match=r"'arms' .* 'arm'"):
        build_station_diagram(scene, station, robot="arms")  # type: ignore[arg-type]
    library = tmp_path / "library"
    shutil.copytree(scene.library.root, library)
    next((library / "mug" / "pieces").iterdir()).unlink()
    document = replace(scene.document, library=str(library))
    save_scene(document, tmp_path / "scene.yaml")
    with pytest.raises(InvalidInputError, match=r"mug\.sdf cannot be loaded .* build the library"):
        build_station_diagram(load_scene(tmp_path / "scene.yaml"), station)


@pytest.mark.parametrize("value", ["<mass>-0.3<", "<mass>0<", "<mass>0.2<", "<ixx>-1<", "<ixx>1<"])
def test_a_body_weighs_what_the_library_says(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], value: str
) -> None:
    """Drake's parser only warns of masses and inertias that cannot be, and takes others."""
    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    shutil.copytree(scene.library.root, tmp_path / "library")
    sdf = tmp_path / "library" / "mug" / "mug.sdf"
    tag = value[1 : value.index(">")]
    sdf.write_text(re.sub(f"<{tag}>[^<]*<", value, sdf.read_text()))
    save_scene(replace(scene.document, library="library"), tmp_path / "scene.yaml")
    with pytest.raises(InvalidInputError, match=r"mug\.sdf cannot be loaded .*(mass|inertia)"):
        build_station_diagram(load_scene(tmp_path / "scene.yaml"), station, robot="none")
    assert capfd.readouterr().err == ""
