"""Objects of BURG-Toolkit and of the YCB set as things to build."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from burg_drake.core import InvalidInputError, Pose, UnknownNameError, make_pose
from burg_drake.formats import YCB_MASS_SOURCE, BurgLibrary, BurgObject, YcbObject
from burg_drake.objects import (
    LibraryDocument,
    MassProperties,
    ObjectEntry,
    ObjectLibrary,
    Source,
    StablePose,
)
from burg_drake.pipeline import burg_sources, compare_poses, fixed_note, ycb_sources


def burg(*objects: BurgObject) -> BurgLibrary:
    return BurgLibrary(
        path=Path("object_library.yaml"), name="demo", description="", objects=objects
    )


def burg_object(identifier: str, mass: float | None = None, **fields: object) -> BurgObject:
    path = Path(f"{identifier}.obj")
    fields = {"name": identifier, "mesh": path, **fields}
    return BurgObject(identifier=identifier, mass=mass, **fields)  # type: ignore[arg-type]


MUG = burg_object("Mug_10f6", 0.1, scale=0.5, friction=0.6, name="white mug")
TABLE = burg_object("table")


def test_what_is_taken_over_from_burg_toolkit() -> None:
    (source,) = burg_sources(burg(MUG))
    assert (source.name, source.mesh, source.description) == (
        "mug_10f6", Path("Mug_10f6.obj"), "white mug",
    )  # fmt: skip
    assert (source.mass, source.density, source.friction, source.scale) == (0.1, None, 0.6, 0.5)


def test_masses_and_density_for_what_burg_toolkit_fixes() -> None:
    mug, table = burg_sources(burg(MUG, TABLE), {"table": 5.0})
    assert (mug.mass, table.mass, table.density) == (0.1, 5.0, None)
    mug, table = burg_sources(burg(MUG, TABLE), density=700.0)
    assert (mug.mass, mug.density, table.mass, table.density) == (0.1, None, None, 700.0)
    (mug,) = burg_sources(burg(MUG, TABLE), skip=["table"])
    assert mug.name == "mug_10f6"


@pytest.mark.parametrize("key", ["Mug_10f6", "mug_10f6"])
def test_a_given_mass_goes_first_under_either_name(key: str) -> None:
    assert [s.mass for s in burg_sources(burg(MUG), {key: 0.3})] == [0.3]


def test_a_given_friction_is_for_objects_without_one() -> None:
    mug, table = burg_sources(burg(MUG, TABLE), {"table": 5.0}, friction=0.3)
    assert (mug.friction, table.friction) == (0.6, 0.3)


def message_of(error: type[Exception], *arguments: object, **keywords: object) -> str:
    with pytest.raises(error) as caught:
        burg_sources(*arguments, **keywords)  # type: ignore[arg-type]
    return str(caught.value)


def test_objects_without_a_mass_are_fixed_and_all_named() -> None:
    walls = [burg_object(f"wall_{i}") for i in range(10)]
    library = burg(MUG, *walls)
    sources = burg_sources(library, {"wall_0": 1.0})
    assert [s.name for s in sources if s.fixed] == [f"wall_{i}" for i in range(1, 10)]
    assert fixed_note(library, sources) == (
        "object_library.yaml: these objects have mass 0 in BURG-Toolkit and become"
        " background, which does not move: wall_1, wall_2, wall_3, wall_4, wall_5,"
        " wall_6, wall_7, wall_8, wall_9"
    )
    assert fixed_note(library, sources[:2]) == ""


def test_values_for_objects_that_are_not_there() -> None:
    assert message_of(UnknownNameError, burg(MUG, TABLE), {"tabel": 1.0}) == (
        "a mass is given for unknown object 'tabel'; did you mean 'table'? Known: mug_10f6, table"
    )
    assert message_of(UnknownNameError, burg(MUG, TABLE), skip=["wall"]) == (
        "skip names unknown object 'wall'; known: mug_10f6, table"
    )
    assert message_of(InvalidInputError, burg(TABLE), {"table": 0.0}) == (
        "table: mass is 0 kg; it must be above 0 (leave it out to use a density)"
    )


def test_identifiers_that_make_one_name() -> None:
    objects = (burg_object("Mug A", 0.1, line=4), burg_object("mug-a", 0.1, line=9))
    assert message_of(InvalidInputError, burg(*objects)) == (
        "object_library.yaml:9: 'Mug A' and 'mug-a' both become object 'mug_a'; rename one of them"
    )


def ycb(name: str, mass: float | None, variant: str = "") -> YcbObject:
    return YcbObject(
        number=name.split("_")[0],
        name=name,
        mesh=Path("textured.obj"),
        variant=variant,
        mass=mass,
        mass_source=YCB_MASS_SOURCE if mass else "",
    )


def test_ycb_objects() -> None:
    objects = [ycb("025_mug", 0.118, "google_16k"), ycb("063-a_marbles", None)]
    mug, marble = ycb_sources(objects, density=2500.0, friction=0.5)
    assert (mug.name, mug.mass, mug.density, mug.scale) == ("025_mug", 0.118, None, 1.0)
    assert mug.description == f"YCB 025 mug, google_16k scan; mass: {YCB_MASS_SOURCE}"
    assert (marble.name, marble.mass, marble.density) == ("063_a_marbles", None, 2500.0)
    assert marble.description == "YCB 063-a marbles"
    assert mug.friction == marble.friction == 0.5


def test_a_weighed_ycb_object() -> None:
    (mug,) = ycb_sources([ycb("025_mug", 0.118)], {"025_mug": 0.12})
    assert (mug.mass, mug.description) == (0.12, "YCB 025 mug")
    with pytest.raises(UnknownNameError) as caught:
        ycb_sources([ycb("025_mug", 0.118)], {"mug": 0.12})
    assert (
        str(caught.value)
        == "a mass is given for unknown object 'mug'; did you mean '025_mug'? Known: 025_mug"
    )


def down(direction: tuple[float, float, float], turn: float = 0.0, height: float = 0.1) -> Pose:
    """`X_SO` with `direction` of O downward, turned about the vertical, at any place."""
    R_SO = Rotation.align_vectors([[0.0, 0.0, -1.0]], [direction])[0]
    R_SO = Rotation.from_euler("z", turn) * R_SO
    return Pose.from_matrix(make_pose(R_SO.as_matrix(), (0.3, turn, height)), quaternion=True)


def library_with(folder: Path, mesh: trimesh.Trimesh, *poses: Pose) -> ObjectLibrary:
    mesh.export(folder / "a.obj")
    entry = ObjectEntry(
        mesh="a.obj",
        sdf="a.sdf",
        pieces=(),
        lower=(0.0, 0.0, 0.0),
        upper=(0.0, 0.0, 0.0),
        mass_properties=MassProperties(
            mass=1.0,
            source="given",
            volume=1.0,
            center_of_mass=(0.0, 0.0, 0.0),
            inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        ),
        stable_poses=tuple(StablePose(probability=0.1, X_SO=X_SO) for X_SO in poses),
        source=Source(file="", sha256=""),
        build="",
    )
    return ObjectLibrary(LibraryDocument(name="l", objects={"a": entry}), folder)


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
NEAR_Z = (0.0, np.sin(0.1), np.cos(0.1))
CORNER = (1.0, 1.0, 1.0)


def test_recorded_poses_of_a_brick(tmp_path: Path) -> None:
    """Six faces are three poses; near-duplicates are one; a corner is none."""
    brick = trimesh.creation.box((0.05, 0.1, 0.2))
    library = library_with(tmp_path, brick, down(X), down(Y), down(Z))
    recorded = [
        down(Z), down(NEAR_Z, 1.0), down((0, 0, -1), 2.0, 7.0), down(X), down(CORNER),
    ]  # fmt: skip
    comparison = compare_poses(recorded, library, "a")
    assert (comparison.n_recorded, comparison.n_distinct, comparison.n_library) == (5, 3, 3)
    assert comparison.unmatched == (4,)
    assert comparison.sentence("object_library.yaml") == (
        "object_library.yaml lists 5 stable poses (3 different), 3 poses found here; 1 of the"
        " listed was not found"
    )


def test_recorded_poses_of_a_can(tmp_path: Path) -> None:
    """It lies the same way on any line of its side."""
    can = trimesh.creation.cylinder(radius=0.03, height=0.1, sections=64)
    library = library_with(tmp_path, can, down(X), down(Z))
    sides = [down((np.cos(a), np.sin(a), 0.0)) for a in np.arange(0.0, 6.0, 0.7)]
    comparison = compare_poses([*sides, down((0, 0, -1))], library, "a")
    assert (comparison.n_recorded, comparison.n_distinct, comparison.unmatched) == (10, 2, ())
    assert (
        comparison.sentence("l.yaml")
        == "l.yaml lists 10 stable poses (2 different), 2 poses found here"
    )
