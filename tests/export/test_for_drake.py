"""SDFormat worlds and model directives, as Drake's own parsers read them."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.multibody.tree import RigidBody

from burg_drake.core import Array
from burg_drake.export import Exported
from burg_drake.scene import Scene
from burg_drake.station import Station, StationDiagram, build_station_diagram
from tests.export.drake_world import DrakeWorld, open_in_drake
from tests.export.mass_matrix import inertia_matrix

Contact = tuple[str, float, float, float, float, float]


@pytest.fixture(scope="module", params=["sdf", "dmd"])
def world(request: pytest.FixtureRequest, exports: dict[str, Exported]) -> DrakeWorld:
    remarks: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = remarks.append  # type: ignore[method-assign]
    logging.getLogger("drake").addHandler(handler)
    try:
        world = open_in_drake(exports[request.param].main)
    finally:
        logging.getLogger("drake").removeHandler(handler)
    assert [r.getMessage() for r in remarks] == []
    return world


def test_everything_is_where_the_documents_put_it(
    world: DrakeWorld, X_WO: dict[str, Array], station: Station
) -> None:
    for name, X in X_WO.items():
        np.testing.assert_allclose(world.X_WB(name), X, atol=1e-15, err_msg=name)
    for name, box in station.document.background.items():
        np.testing.assert_allclose(world.X_WB(name), box.X_WB.matrix(), atol=1e-15)
    assert world.X_WB("table")[2, 3] == -station.document.table.size[2] / 2


def test_what_is_free_and_what_is_not(world: DrakeWorld, scene: Scene, station: Station) -> None:
    free = {n for n in scene.instances if world.body(n).is_floating_base_body()}
    assert free == set(scene.instances)
    anchored = {b.index() for b in world.plant.GetBodiesWeldedTo(world.plant.world_body())}
    for name in ("bowl", "table", *station.document.background):
        assert world.body(name).index() in anchored


def test_bodies_weigh_what_the_library_says(world: DrakeWorld, scene: Scene) -> None:
    for name in scene.instances:
        listed = scene.entry(name).mass_properties
        inertia = world.body(name).default_spatial_inertia()
        about = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        assert inertia.get_mass() == pytest.approx(listed.mass, rel=1e-12)
        np.testing.assert_allclose(inertia.get_com(), listed.center_of_mass, atol=1e-12)
        np.testing.assert_allclose(about, inertia_matrix(listed.inertia), atol=1e-9)


def contact(world: StationDiagram | DrakeWorld, body: RigidBody) -> list[Contact]:
    """Friction, dissipation and hydroelastic modulus of a body's geometries, and their shapes."""
    inspector = world.scene_graph.model_inspector()
    found = []
    for geometry in world.plant.GetCollisionGeometriesForBody(body):
        properties = inspector.GetProximityProperties(geometry)
        friction = properties.GetProperty("material", "coulomb_friction")
        assert properties.HasProperty("hydroelastic", "compliance_type")
        found.append(
            (
                type(inspector.GetShape(geometry)).__name__,
                friction.static_friction(),
                friction.dynamic_friction(),
                properties.GetProperty("material", "hunt_crossley_dissipation"),
                properties.GetPropertyOrDefault("hydroelastic", "hydroelastic_modulus", np.inf),
                properties.GetPropertyOrDefault("hydroelastic", "resolution_hint", np.inf),
            )
        )
    return found


def test_contact_is_that_of_trials(world: DrakeWorld, scene: Scene, station: Station) -> None:
    ours = build_station_diagram(scene, station, robot="none")
    for index, name in ours.body_names.items():
        listed = contact(ours, ours.plant.get_body(index))
        assert listed
        assert contact(world, world.body(name)) == listed


def test_there_is_something_to_look_at(world: DrakeWorld, X_WO: dict[str, Array]) -> None:
    inspector = world.scene_graph.model_inspector()
    for name in (*X_WO, "table"):
        frame = world.plant.GetBodyFrameIdOrThrow(world.body(name).index())
        assert inspector.NumGeometriesForFrameWithRole(frame, Role.kIllustration) >= 1


def test_objects_stay(world: DrakeWorld, scene: Scene, X_WO: dict[str, Array]) -> None:
    world.simulator.AdvanceTo(0.3)
    for name in scene.instances:
        moved = world.X_WB(name) - X_WO[name]
        assert np.abs(moved[:3, 3]).max() < 5e-4, name
        assert np.abs(moved[:3, :3]).max() < 5e-3, name
