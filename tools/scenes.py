"""Writes the built-in scenes: objects laid out by hand, brought to rest in simulation.

Run `python -m tools.scenes` after the household library has changed; the tests of the built-in
scenes say when that is due.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from pydrake.systems.analysis import Simulator

from burg_drake.core import (
    Array,
    Pose,
    data_root,
    inverse,
    make_pose,
    rot_z,
    rotation_angle,
    save_document,
    transform_points,
)
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Instance, Scene, SceneDocument, read_vertices
from burg_drake.station import ENGINES, build_station_diagram, load_station

LIBRARY = "household"
STATION = "panda_tabletop"

Layout = tuple[tuple[str, float, float, float], ...]
"""Object (`_2` for a second one), x and y of the middle of its footprint [m], heading [degrees]."""

SCENES: dict[str, tuple[str, Layout]] = {
    "tabletop_six": (
        "Six household objects, each free from above and from the sides",
        (
            ("mug", 0.115, 0.115, 140.0),
            ("bottle", 0.290, 0.105, 20.0),
            ("box", 0.475, 0.115, 75.0),
            ("screwdriver", 0.120, 0.315, -35.0),
            ("bowl", 0.305, 0.310, 0.0),
            ("banana", 0.490, 0.305, 60.0),
        ),
    ),
    "tabletop_close": (
        "The six objects of tabletop_six close together, as on a cluttered table",
        (
            ("mug", 0.174, 0.225, 165.0),
            ("bottle", 0.265, 0.120, 80.0),
            ("box", 0.390, 0.126, 83.0),
            ("screwdriver", 0.275, 0.366, 4.0),
            ("bowl", 0.318, 0.264, 0.0),
            ("banana", 0.442, 0.270, 75.0),
        ),
    ),
    "tabletop_twelve": (
        "Twelve household objects, of some of them two, that fill the board",
        (
            ("mug", 0.080, 0.075, 140.0),
            ("bottle", 0.205, 0.070, 20.0),
            ("box", 0.335, 0.065, 80.0),
            ("can", 0.470, 0.070, 0.0),
            ("bottle_2", 0.555, 0.130, 90.0),
            ("screwdriver", 0.125, 0.185, -12.0),
            ("bowl", 0.325, 0.215, 0.0),
            ("can_2", 0.460, 0.190, 0.0),
            ("mug_2", 0.525, 0.255, 100.0),
            ("scissors", 0.115, 0.325, 5.0),
            ("banana", 0.320, 0.362, 10.0),
            ("box_2", 0.500, 0.365, 75.0),
        ),
    ),
}
HEADER = "Laid out and brought to rest by tools/scenes.py (python -m tools.scenes)."

SETTLING_TIME = 4.0
"""Simulated for each round [s]."""
ROUNDS = 4
STILL = (2e-5, np.deg2rad(0.02))
"""An object that moves [m] and turns [rad] by less keeps the pose it was laid out with."""


def main() -> None:
    """Writes all scenes."""
    library = load_library(LIBRARY)
    for name, (description, layout) in SCENES.items():
        instances = tuple(lay_out(library, *place) for place in layout)
        document = SceneDocument(
            name=name, description=description, library=LIBRARY, instances=instances
        )
        path = data_root() / "scenes" / f"{name}.yaml"
        for _ in range(ROUNDS):
            before, document = document, settle(Scene(document, library, path))
            if document == before:
                break
        save_document(document, path, HEADER)
        print(f"wrote {path}")


def lay_out(library: ObjectLibrary, name: str, x: float, y: float, heading: float) -> Instance:
    """An object as its mesh stands, turned by a heading [degrees], with its lowest collision
    piece on the board and the middle of its footprint at x, y [m]."""
    object_name = name.removesuffix("_2")
    entry = library.entry(object_name)
    pieces = np.concatenate([read_vertices(library.path(p)) for p in entry.pieces])
    R_SO = rot_z(np.deg2rad(heading))
    points = read_vertices(library.path(entry.mesh)) @ R_SO.T
    middle = (points.min(axis=0) + points.max(axis=0))[:2] / 2
    return Instance(
        name="" if name == object_name else name,
        object=object_name,
        X_SO=rounded(make_pose(R_SO, (x - middle[0], y - middle[1], -pieces[:, 2].min()))),
    )


def settle(scene: Scene) -> SceneDocument:
    """The scene's document after a few simulated seconds; what stood still is left as it was."""
    station = load_station(STATION)
    built = build_station_diagram(scene, station, robot="none", engine=ENGINES["reference"])
    simulator = Simulator(built.diagram)
    simulator.AdvanceTo(SETTLING_TIME)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    X_SW = inverse(station.document.X_WS.matrix())
    instances = []
    for name, instance in scene.instances.items():
        body = built.plant.get_body(built.free[name])
        X_WO = built.plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        if moved(scene, name, inverse(built.X_WO(name)) @ X_WO):
            instance = dataclasses.replace(instance, X_SO=rounded(X_SW @ X_WO))
        instances.append(instance)
    return dataclasses.replace(scene.document, instances=tuple(instances))


def moved(scene: Scene, name: str, X_OO: Array) -> bool:
    """Whether a displacement (4, 4), seen from the object, is more than a trifle."""
    p_OOcm = np.array([scene.entry(name).mass_properties.center_of_mass])
    distance = np.linalg.norm(transform_points(X_OO, p_OOcm) - p_OOcm)
    return bool(distance > STILL[0] or rotation_angle(X_OO[:3, :3]) > STILL[1])


def rounded(X_SO: Array) -> Pose:
    """A pose to the micrometre and a ten thousandth of a degree, as people can read it."""
    exact = Pose.from_matrix(X_SO)
    x, y, z = (round(value, 6) + 0.0 for value in exact.translation)
    roll, pitch, yaw = (round(value, 4) + 0.0 for value in exact.rpy_deg or (0.0, 0.0, 0.0))
    return Pose((x, y, z), rpy_deg=(roll, pitch, yaw))


if __name__ == "__main__":
    main()
