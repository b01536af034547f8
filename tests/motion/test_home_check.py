"""An arm that stands in something, and one that collides at home, by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Pose
from burg_drake.motion import (
    ArmCollision,
    base_overlaps,
    empty_scene,
    home_clearance,
    require_free_home,
)
from burg_drake.scene import Instance, load_scene
from burg_drake.station import (
    Obstacle,
    Station,
    StationDiagram,
    build_station_diagram,
    load_station,
)

TIP = 0.487
"""Roughly the height of the lowest points of the fingers at home [m]."""


def with_box(name: str, x: float, z: float, size: tuple[float, float, float]) -> Station:
    station = load_station("panda_tabletop")
    box = Obstacle(X_WB=Pose((x, 0.0, z)), size=size)
    return replace(station, document=replace(station.document, background={name: box}))


def built(station: Station) -> StationDiagram:
    return build_station_diagram(empty_scene(), station, robot="arm", weld_objects=True)


def test_a_box_that_cuts_into_the_base() -> None:
    """Link 0 reaches 71 mm to the front of its axis."""
    diagram = built(with_box("post", 0.15, 0.1, (0.2, 0.1, 0.2)))
    assert {overlap.name for overlap in base_overlaps(diagram)} == {"post"}
    with pytest.raises(InvalidInputError) as error:
        require_free_home(diagram, ArmCollision(diagram))
    depth = 1e3 * base_overlaps(diagram)[0].depth
    assert str(error.value).startswith(
        f"{diagram.station.path}: arm.X_WA puts the arm's base {depth:.0f} mm deep into 'post' by"
        " its collision shapes (panda_link0 '"
    )
    assert str(error.value).endswith(
        "); move the base or the obstacle, or write arm.stands_in: [post] if the base is mounted"
        " inside it"
    )
    assert base_overlaps(built(with_box("post", 0.25, 0.1, (0.2, 0.1, 0.2)))) == ()


def test_a_base_plate_that_dips_below_the_table(tmp_path: Path) -> None:
    """A plate of 40 mm about the base's origin is 20 mm in the table: raised by that much, or
    allowed to be let in, it can be used, and what may move still collides with the table."""
    usual = load_station("panda_tabletop")
    assert usual.arm_model is not None and usual.document.arm is not None
    folder = usual.arm_model.parent
    text = usual.arm_model.read_text().replace("<uri>meshes/", f"<uri>{folder}/meshes/")
    plate = "<collision name='dip'><geometry><box><size>0.3 0.3 0.04</size></box></geometry>"
    model = tmp_path / "arm.sdf"
    link = '<link name="panda_link0">'
    assert link in text
    model.write_text(text.replace(link, f"{link}{plate}</collision>"))
    usual = replace(usual, arm_model=model)

    def with_arm(**changed: object) -> StationDiagram:
        arm = replace(usual.document.arm, **changed)
        return built(replace(usual, document=replace(usual.document, arm=arm)))

    sunk = with_arm()
    with pytest.raises(InvalidInputError) as error:
        require_free_home(sunk, ArmCollision(sunk))
    assert str(error.value) == (
        f"{usual.path}: arm.X_WA puts the arm's base 20 mm deep into 'table' by its collision"
        " shapes (panda_link0 'dip' 20 mm); raise the base by 20 mm (arm.X_WA.translation:"
        " [0, 0, 0.02]), or write arm.stands_in: [table] if the base is mounted inside it"
    )
    for good in (with_arm(X_WA=Pose((0.0, 0.0, 0.02))), with_arm(stands_in=("table",))):
        require_free_home(good, ArmCollision(good))
    lying = np.array([0.0, 1.7, 0.0, -0.1, 0.0, 1.6, 0.785])
    pairs = {(o.link, o.other) for o in ArmCollision(good).overlaps(lying)}
    assert any(other == "table" for _, other in pairs)
    assert all(link != "panda_link0" for link, _ in pairs)


def test_what_collides_at_home_is_named() -> None:
    diagram = built(with_box("crate", 0.36, 0.55, (0.1, 0.4, 0.1)))
    with pytest.raises(InvalidInputError) as error:
        require_free_home(diagram, ArmCollision(diagram))
    text = str(error.value)
    assert text.startswith(
        f"{diagram.station.path}: at arm.home the arm collides in scene 'empty_board': "
    )
    assert "panda_hand with crate" in text
    assert text.endswith("; change arm.home or move the obstacle")


def test_a_tall_object_under_the_hand_is_named() -> None:
    scene = load_scene("tabletop_six")
    box = Instance(object="box", X_SO=Pose((0.297, 0.067, 0.4)))
    scene = replace(scene, document=replace(scene.document, instances=(box,)))
    station = load_station("panda_tabletop")
    diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
    with pytest.raises(InvalidInputError, match=r"in scene 'tabletop_six': .* with box"):
        require_free_home(diagram, ArmCollision(diagram))


def test_clearance_at_home_is_that_of_the_nearest_pair() -> None:
    """A plate under the fingers: nearer by as much as it is higher."""
    high, low = (
        home_clearance(built(with_box("plate", 0.307, TIP - gap - 0.005, (0.2, 0.3, 0.01))))
        for gap in (0.02, 0.025)
    )
    assert {high.other, low.other} == {"plate"}
    assert high.link.endswith("finger") or "finger" in high.link
    assert low.distance - high.distance == pytest.approx(0.005, abs=1e-6)
    assert 0.01 < high.distance < 0.03


@pytest.mark.parametrize("name", ["panda_bin", "panda_shelf", "panda_pedestal", "ur5e_tabletop"])
def test_built_in_stations_are_free(name: str) -> None:
    diagram = built(load_station(name))
    require_free_home(diagram, ArmCollision(diagram))
    assert home_clearance(diagram).distance > 0.01
