"""What is in a stable pose of its library stands on the board, however its pieces were cut; what is
lower does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array, Pose, make_pose, transform_points
from burg_drake.objects import Decomposition, ObjectLibrary, load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument, surface_vertices, validate_scene
from burg_drake.simulation import settle_scene
from burg_drake.station import SceneCheck, Station, StationDocument, Table, load_station

SIZE = (0.08, 0.06, 0.04)
"""Of a brick, whose pieces reach beyond it, or not as far [m]."""
LOWERED = 2e-3
YAWS = np.deg2rad([0.0, 37.0, 161.0, 290.0])


@pytest.fixture(scope="module")
def bare() -> Station:
    """A table without an arm; the board is turned and lies beside the world's origin."""
    panda = load_station("panda_tabletop")
    document = StationDocument(
        name="bare",
        table=Table(size=(3.0, 3.0, 0.1)),
        X_WS=Pose((0.3, -0.2, 0.0), rpy_deg=(0.0, 0.0, 30.0)),
    )
    return Station(document, panda.hand, panda.hand_model, None, Path("bare.yaml"))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> ObjectLibrary:
    """Bricks in halves that are larger or smaller all around, and a bent bar whose few pieces are
    far from it."""
    out = tmp_path_factory.mktemp("standing")
    sources = [
        ObjectSource(
            name=name, mesh=trimesh.creation.box(SIZE), mass=0.3, pieces=_halves(by), contact=kind
        )
        for name, by, kind in (
            ("bulging", 1.3e-3, "surface"),
            ("far_bulging", 3.2e-3, "pieces"),
            ("shrunk", -1.9e-3, "surface"),
            ("far_shrunk", -3.2e-3, "pieces"),
            ("rigid", 1.3e-3, "mesh"),
        )
    ]
    bar = ObjectSource(
        name="bar", mesh=_bent_bar(), mass=0.3, decomposition=Decomposition(threshold=0.3)
    )
    assert not build_library([*sources, bar], out, confirm=False).failed
    return load_library(out)


def test_every_stable_pose_of_the_household(bare: Station) -> None:
    library = load_library("household")
    _require_standing(library, bare, library.document.objects)


@pytest.mark.thorough
def test_stable_poses_of_what_its_pieces_do_not_fit(made: ObjectLibrary, bare: Station) -> None:
    bottoms = {name: _bottoms(made, name) for name in made.document.objects}
    assert bottoms["bulging"] == pytest.approx([1.3e-3] * 3, abs=1e-9)
    assert bottoms["far_bulging"] == pytest.approx([3.2e-3] * 3, abs=1e-9)
    assert bottoms["shrunk"] == pytest.approx([-1.9e-3] * 3, abs=1e-9)
    assert min(bottoms["bar"]) < -1.5e-3
    _require_standing(made, bare, [name for name in bottoms if name != "far_bulging"])


@pytest.mark.parametrize("name", ["bulging", "far_bulging", "shrunk", "far_shrunk", "rigid"])
def test_it_settles_where_it_stands(name: str, made: ObjectLibrary, bare: Station) -> None:
    check = SceneCheck(bare, made)
    for k in range(len(made.entry(name).stable_poses)):
        scene = _scene(made, name, _placed(made, name, k, 0.7))
        settled = settle_scene(scene, bare)
        assert settled.at_rest and settled.displacements[name].distance < 4e-3
        assert check.issues(settled.scene) == ()


def test_what_stands_with_its_own_surface_stands(made: ObjectLibrary, bare: Station) -> None:
    """Its pieces are in the table by 3.2 mm, which no true surface is until it is lowered."""
    check = SceneCheck(bare, made)
    for lowered, kinds in ((0.0, []), (LOWERED, ["in_ground"])):
        X_SO = make_pose(p_AB=(0.3, 0.3, SIZE[2] / 2 - lowered))
        scene = _scene(made, "far_bulging", X_SO)
        assert [i.kind for i in check.issues(scene)] == kinds
        assert [i.kind for i in validate_scene(scene)] == kinds


def test_how_deep_it_is_goes_by_what_it_rests_with(made: ObjectLibrary, bare: Station) -> None:
    (issue,) = SceneCheck(bare, made).issues(
        _scene(made, "shrunk", make_pose(p_AB=(0.3, 0.3, SIZE[2] / 2 - 1.9e-3 - LOWERED)))
    )
    assert issue.amount == pytest.approx(LOWERED, abs=1e-9)
    assert issue.message == (
        "'shrunk' reaches 2.0 mm below the surface of the board; set z = 0.0181 to put it on top"
    )


def test_what_neither_reaches_down_to_hovers(made: ObjectLibrary, bare: Station) -> None:
    check = SceneCheck(bare, made)
    for name, lowest in (("far_bulging", 3.2e-3), ("shrunk", 0.0)):
        for height, kinds in ((0.9e-3, []), (1.1e-3, ["hovering"])):
            X_SO = make_pose(p_AB=(0.3, 0.3, SIZE[2] / 2 + lowest + height))
            issues = check.issues(_scene(made, name, X_SO))
            assert [issue.kind for issue in issues] == kinds
            assert [issue.amount for issue in issues] == pytest.approx([height] * len(kinds))


def test_a_heavy_roll_in_the_table_is_borne(tmp_path: Path, bare: Station) -> None:
    """A steel rod, which meets the table along a line, sinks in by 1.6 mm; it does not lie there
    without its weight."""
    rod = trimesh.creation.cylinder(0.01, 0.1, sections=128)
    sources = [
        ObjectSource(name=name, mesh=rod, mass=m) for name, m in (("rod", 2.0), ("reed", 0.2))
    ]
    assert not build_library(sources, tmp_path, confirm=False).failed
    library = load_library(tmp_path)
    entry = library.entry("rod")
    assert entry.contact.primitive is not None and entry.contact.primitive.shape == "cylinder"
    check = SceneCheck(bare, library)
    lying = next(k for k, pose in enumerate(entry.stable_poses) if pose.rolls)
    settled = settle_scene(_scene(library, "rod", _placed(library, "rod", lying, 0.4)), bare).scene
    X_SO = settled.X_SO("rod")
    sunk = 0.01 - float(X_SO[2, 3])
    assert 1.5e-3 < sunk < 1.7e-3
    (issue,) = check.issues(settled)
    assert issue.kind == "sunken" and not issue.is_error
    assert issue.amount == pytest.approx(sunk, abs=2e-5)
    assert [i.kind for i in check.issues(_scene(library, "reed", X_SO))] == ["in_ground"]


def _require_standing(library: ObjectLibrary, station: Station, names: object) -> None:
    """Every stable pose of objects stands, whatever its turn, and is in the ground when lowered."""
    check, looked_at = SceneCheck(station, library), 0
    for name in names:  # type: ignore[attr-defined]
        for k in range(len(library.entry(name).stable_poses)):
            for yaw in YAWS:
                X_SO = _placed(library, name, k, yaw)
                scene = _scene(library, name, X_SO)
                assert check.issues(scene) == () and validate_scene(scene) == (), (name, k, yaw)
                X_SO[2, 3] -= LOWERED
                kinds = [i.kind for i in check.issues(_scene(library, name, X_SO))]
                assert kinds == ["in_ground"], (name, k, yaw)
                looked_at += 1
    assert looked_at > 50


def _placed(library: ObjectLibrary, name: str, stable_pose: int, yaw: float) -> Array:
    """(4, 4) X_SO in a stable pose, turned about the vertical."""
    c, s = np.cos(yaw), np.sin(yaw)
    R_SZ = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return make_pose(R_SZ, (0.3, 0.3, 0.0)) @ library.entry(name).X_SO(stable_pose)


def _scene(library: ObjectLibrary, name: str, X_SO: Array) -> Scene:
    document = SceneDocument(
        name="standing",
        library=str(library.root),
        board=Board(size=(0.6, 0.6)),
        instances=(Instance(object=name, X_SO=Pose.from_matrix(X_SO, quaternion=True)),),
    )
    return Scene(document, library, Path("scene.yaml"))


def _bottoms(library: ObjectLibrary, name: str) -> list[float]:
    """Heights of an object's surface over the plane on which it rests, in each stable pose [m]."""
    p_OV = surface_vertices(library, name)
    poses = range(len(library.entry(name).stable_poses))
    return [float(transform_points(library.entry(name).X_SO(k), p_OV)[:, 2].min()) for k in poses]


def _halves(by: float) -> tuple[trimesh.Trimesh, ...]:
    """Two halves of the brick, which reach beyond it all around [m]."""
    x, y, z = np.array(SIZE) + 2.0 * by
    return tuple(
        trimesh.creation.box((x / 2, y, z)).apply_translation((side * x / 4, 0.0, 0.0))
        for side in (-1.0, 1.0)
    )


def _bent_bar() -> trimesh.Trimesh:
    """A flat bar with a bend of 100 degrees and a radius of 0.2 m, of elliptic section."""
    bend, turn = np.linspace(-0.9, 0.9, 40), 2.0 * np.pi * np.arange(24) / 24
    radius = 0.2 - 0.01 * np.cos(turn)
    rings = np.stack(
        [
            np.outer(np.sin(bend), radius),
            np.broadcast_to(0.025 * np.sin(turn), (40, 24)),
            0.2 - np.outer(np.cos(bend), radius),
        ],
        axis=2,
    )
    ends = [rings[0].mean(axis=0), rings[-1].mean(axis=0)]
    faces = []
    for j in range(24):
        k = (j + 1) % 24
        faces += [[40 * 24, k, j], [40 * 24 + 1, 39 * 24 + j, 39 * 24 + k]]
        for i in range(0, 39 * 24, 24):
            faces += [[i + j, i + k, i + 24 + k], [i + j, i + 24 + k, i + 24 + j]]
    mesh = trimesh.Trimesh(np.vstack([rings.reshape(-1, 3), ends]), faces)
    mesh.fix_normals()
    return mesh
