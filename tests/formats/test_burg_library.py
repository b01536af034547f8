"""Object libraries as BURG-Toolkit writes them, and what can be wrong with them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import DocumentError
from burg_drake.formats import locate_file, read_burg_library

# What `yaml.dump` makes of an ObjectLibrary: sorted keys, block lists, null for what is not known.
WRITTEN = """\
description: no description available
name: demo
objects:
- friction_coeff: 0.24
  identifier: 004_sugar_box
  mass: 0.4
  mesh_fn: meshes/004_sugar_box.obj
  name: sugar box
  scale: 1.0
  stable_poses:
    poses:
    - - - 1.0
        - 0.0
        - 0.0
        - 0.01
      - - 0.0
        - 0.0
        - -1.0
        - -0.02
      - - 0.0
        - 1.0
        - 0.0
        - 0.03
      - - 0.0
        - 0.0
        - 0.0
        - 1.0
    - - - 0.0
        - -1.0
        - 0.0
        - 1.0e-05
      - - 1.0
        - 0.0
        - 0.0
        - 0.0
      - - 0.0
        - 0.0
        - 1.0
        - 0.045
      - - 0.0
        - 0.0
        - 0.0
        - 1.0
    probabilities:
    - 0.2
    - 0.75
  thumbnail_fn: null
  urdf_fn: urdf/004_sugar_box.urdf
  vhacd_fn: vhacd/004_sugar_box_vhacd.obj
- friction_coeff: 0.5
  identifier: Mug_10f6
  mass: 0
  mesh_fn: meshes/mug.obj
  name: Mug_10f6
  scale: 0.0023
  stable_poses: null
  thumbnail_fn: null
  urdf_fn: null
  vhacd_fn: null
yaml_file_type: ObjectLibrary
yaml_file_version: '1.0'
"""

HEAD = "yaml_file_type: ObjectLibrary\nyaml_file_version: '1.0'\nname: a\ndescription: b\n"
IDENTITY = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"


def written(folder: Path, text: str) -> Path:
    path = folder / "object_library.yaml"
    path.write_text(text)
    return path


def test_a_file_as_burg_toolkit_writes_it(tmp_path: Path) -> None:
    path = written(tmp_path, WRITTEN)
    library = read_burg_library(path)
    assert (library.path, library.name, library.notes) == (path, "demo", ())
    box, mug = library.objects
    assert (box.identifier, box.name, box.mass, box.friction, box.scale) == (
        "004_sugar_box", "sugar box", 0.4, 0.24, 1.0,
    )  # fmt: skip
    assert box.mesh == tmp_path / "meshes/004_sugar_box.obj"
    assert (mug.identifier, mug.mass, mug.friction, mug.scale) == ("Mug_10f6", None, 0.5, 0.0023)
    assert mug.stable_poses == ()
    assert [WRITTEN.splitlines()[o.line - 1] for o in library.objects] == [
        "- friction_coeff: 0.24",
        "- friction_coeff: 0.5",
    ]


def test_stable_poses_come_most_probable_first(tmp_path: Path) -> None:
    first, second = read_burg_library(written(tmp_path, WRITTEN)).objects[0].stable_poses
    assert (first.probability, second.probability) == (0.75, 0.2)
    turned = np.array([[0, -1, 0, 1e-5], [1, 0, 0, 0], [0, 0, 1, 0.045], [0, 0, 0, 1]], float)
    tipped = np.array([[1, 0, 0, 0.01], [0, 0, -1, -0.02], [0, 1, 0, 0.03], [0, 0, 0, 1]], float)
    np.testing.assert_allclose(first.X_SO.matrix(), turned, atol=1e-15)
    np.testing.assert_allclose(second.X_SO.matrix(), tipped, atol=1e-15)


def test_a_folder_stands_for_the_file_in_it(tmp_path: Path) -> None:
    path = written(tmp_path, WRITTEN)
    assert read_burg_library(tmp_path) == read_burg_library(path)


def test_nothing_but_identifier_and_mesh_is_needed(tmp_path: Path) -> None:
    text = HEAD + "objects:\n- {identifier: a, mesh_fn: a.obj}\n"
    (item,) = read_burg_library(written(tmp_path, text)).objects
    assert (item.name, item.mass, item.friction, item.scale) == ("a", None, None, 1.0)
    assert item.stable_poses == ()


@pytest.mark.parametrize("mass", ["0", "0.0", "null", "~", ""])
def test_mass_0_or_none_is_fixed(tmp_path: Path, mass: str) -> None:
    text = f"{HEAD}objects:\n- identifier: a\n  mesh_fn: a.obj\n  mass: {mass}\n"
    (item,) = read_burg_library(written(tmp_path, text)).objects
    assert item.mass is None


def test_null_stands_for_the_default_everywhere(tmp_path: Path) -> None:
    keys = ("name", "friction_coeff", "scale", "stable_poses", "urdf_fn", "vhacd_fn")
    lines = "".join(f"  {key}: null\n" for key in keys)
    text = f"{HEAD}objects:\n- identifier: a\n  mesh_fn: a.obj\n{lines}"
    bare = HEAD + "objects:\n- identifier: a\n  mesh_fn: a.obj\n"
    with_nulls = read_burg_library(written(tmp_path, text))
    assert with_nulls == read_burg_library(written(tmp_path, bare))


def test_a_library_from_another_machine_finds_its_meshes(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for name in ("a", "b", "c"):
        (tmp_path / f"meshes/{name}.obj").write_text("")
    (tmp_path / "d.obj").write_text("")
    text = HEAD + (
        "objects:\n"
        "- {identifier: a, mesh_fn: meshes\\a.obj}\n"
        "- {identifier: b, mesh_fn: /home/someone/library/meshes/b.obj}\n"
        "- {identifier: c, mesh_fn: 'C:\\Users\\someone\\meshes\\c.obj'}\n"
        "- {identifier: d, mesh_fn: ../../elsewhere/d.obj}\n"
        "- {identifier: e, mesh_fn: ../e.obj}\n"
    )
    meshes = [item.mesh for item in read_burg_library(written(tmp_path, text)).objects]
    assert meshes == [
        tmp_path / "meshes/a.obj",
        tmp_path / "meshes/b.obj",
        tmp_path / "meshes/c.obj",
        tmp_path / "d.obj",
        tmp_path / "../e.obj",  # there is none: as it is named
    ]


def test_a_mesh_where_it_is_named_goes_first(tmp_path: Path) -> None:
    folder = tmp_path / "library"
    folder.mkdir()
    (folder / "a.obj").write_text("")
    (tmp_path / "a.obj").write_text("")
    text = HEAD + "objects:\n- {identifier: a, mesh_fn: ../a.obj}\n"
    assert read_burg_library(written(folder, text)).objects[0].mesh == folder / "../a.obj"


def test_unknown_keys_are_left_aside_with_a_note(tmp_path: Path) -> None:
    text = HEAD + "author: c\nobjects:\n- identifier: a\n  mesh_fn: a.obj\n  friction_coef: 0.7\n"
    library = read_burg_library(written(tmp_path, text))
    assert library.objects[0].friction is None
    path = library.path
    assert library.notes == (
        f"{path}:5: unknown key 'author' was ignored; known: description, name, objects,"
        " yaml_file_type, yaml_file_version",
        f"{path}:9: objects[0]: unknown key 'friction_coef' was ignored; did you mean"
        " 'friction_coeff'? Known: friction_coeff, identifier, mass, mesh_fn, name, scale,"
        " stable_poses, thumbnail_fn, urdf_fn, vhacd_fn",
    )


def one_object(lines: str) -> str:
    return f"{HEAD}objects:\n- identifier: mug\n  mesh_fn: mug.obj\n{lines}"


def poses(*matrices: str, probabilities: str = "[0.5]") -> str:
    listed = "".join(f"    - {matrix}\n" for matrix in matrices)
    return one_object(f"  stable_poses:\n    probabilities: {probabilities}\n    poses:\n{listed}")


TURNED = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "FILE: the document is empty"),
        ("- 1\n", "FILE:1: expected keys with values ('key: value' lines)"),
        ("name: [a\n", "FILE:2: not valid YAML: did not find expected ',' or ']'"),
        ("name: a\nobjects: []\n",
         "FILE:1: yaml_file_type: missing; if this is an object library of an early BURG-Toolkit,"
         " which did not write it, add the lines 'yaml_file_type: ObjectLibrary' and"
         " 'yaml_file_version: \"1.0\"'"),
        ("yaml_file_type: Scene\nyaml_file_version: '1.0'\n",
         ("FILE:1: yaml_file_type: 'Scene' cannot be read; expected 'ObjectLibrary'; give"
             " the object library that the scene names under object_library_fn")),
        (HEAD.replace("1.0", "2.0") + "objects: []\n",
         "FILE:2: yaml_file_version: '2.0' cannot be read; expected '1.0'"),
        (HEAD, "FILE:1: key 'objects' is missing"),
        (HEAD + "objects:\n  mug:\n    mesh_fn: mug.obj\n",
         "FILE:6: objects: expected a list such as [a, b, c]"),
        (HEAD + "objects:\n- mesh_fn: mug.obj\n",
         "FILE:6: objects[0]: key 'identifier' is missing"),
        (HEAD + "objects:\n- identifier: ''\n  mesh_fn: mug.obj\n",
         "FILE:6: objects[0]: identifier is empty; give the object a name"),
        (HEAD + "objects:\n- identifier: mug\n",
         ("FILE:6: objects[0]: 'mug' has no mesh_fn: BURG-Toolkit had its mesh only in"
             " memory; save the mesh to a file and name it here")),
        (HEAD + "objects:\n- identifier: mug\n  mesh_fn: null\n",
         ("FILE:6: objects[0]: 'mug' has no mesh_fn: BURG-Toolkit had its mesh only in"
             " memory; save the mesh to a file and name it here")),
        (one_object("- identifier: mug\n  mesh_fn: b.obj\n"),
         ("FILE:8: objects[1].identifier: 'mug' is taken by the object in line 6;"
             " identifiers must differ")),
        (one_object("  mesh_fn: b.obj\n"), "FILE:8: objects[0]: key 'mesh_fn' is given twice"),
        (one_object("  mass: light\n"),
         "FILE:8: objects[0].mass: 'light' is not a finite number"),
        (one_object("  mass: .nan\n"), "FILE:8: objects[0].mass: '.nan' is not a finite number"),
        (one_object("  mass: !!python/object/apply:numpy.core.multiarray.scalar\n  - 1\n"),
         "FILE:8: tag 'tag:yaml.org,2002:python/ob...numpy.core.multiarray.scalar' is not"
         " supported; leave it out"),
        (one_object("  mass: -0.1\n"),
         "FILE:6: objects[0]: mass of 'mug' is -0.1; it must be >= 0"),
        (one_object("  friction_coeff: -1\n"),
         "FILE:6: objects[0]: friction_coeff of 'mug' is -1; it must be >= 0"),
        (one_object("  scale: 0\n"),
         "FILE:6: objects[0]: scale of 'mug' is 0; it must be above 0"),
        (one_object("  stable_poses: []\n"),
         "FILE:8: objects[0].stable_poses: expected keys with values ('key: value' lines)"),
        (one_object("  stable_poses: {poses: []}\n"),
         "FILE:8: objects[0].stable_poses: key 'probabilities' is missing"),
        (poses(IDENTITY, IDENTITY),
         "FILE:9: objects[0].stable_poses: has 1 probabilities, but 2 poses; give one"
         " probability for each pose"),
        (poses(IDENTITY, probabilities="[-0.5]"),
         "FILE:9: objects[0].stable_poses: probabilities[0] is -0.5; it must be >= 0"),
        (poses("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]"),
         "FILE:11: objects[0].stable_poses.poses[0]: has 3 entries; expected 4"),
        (poses("[[1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"),
         "FILE:11: objects[0].stable_poses.poses[0][0]: has 3 entries; expected 4"),
        (poses(IDENTITY, IDENTITY.replace("[0, 1, 0, 0]", "[0, 2, 0, 0]"),
               probabilities="[0.5, 0.4]"),
         "FILE:9: objects[0].stable_poses: poses[1] is not a rigid transform: its rotation part is"
         " off by 3 from orthonormal"),
        (poses(IDENTITY.replace("[0, 1, 0, 0]", "[0, -1, 0, 0]")),
         ("FILE:9: objects[0].stable_poses: poses[0] is not a rigid transform: its"
             " rotation part is a reflection (determinant -1)")),
        (poses(IDENTITY.replace("[0, 0, 0, 1]", "[0, 0, 1, 1]")),
         "FILE:9: objects[0].stable_poses: poses[0] has a last row that is not 0 0 0 1"),
    ],
)  # fmt: skip
def test_messages_name_file_line_key_and_remedy(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(DocumentError) as caught:
        read_burg_library(path)
    assert str(caught.value) == message.replace("FILE", str(path))


def test_a_pose_of_any_rotation_is_rigid(tmp_path: Path) -> None:
    c = repr(TURNED)
    turned = f"[[{c}, -{c}, 0, 0], [{c}, {c}, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]]"
    (pose,) = read_burg_library(written(tmp_path, poses(turned))).objects[0].stable_poses
    np.testing.assert_allclose(pose.X_SO.matrix()[0], [TURNED, -TURNED, 0, 0], atol=1e-15)


def test_the_version_may_have_lost_its_quotes(tmp_path: Path) -> None:
    text = WRITTEN.replace("'1.0'", "1.0")
    assert len(read_burg_library(written(tmp_path, text)).objects) == 2


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(DocumentError) as caught:
        read_burg_library(tmp_path)
    assert str(caught.value) == (
        f"cannot read {tmp_path / 'object_library.yaml'}: No such file or directory"
    )


def test_a_name_that_is_too_long_for_a_file_is_one_that_is_not_there(tmp_path: Path) -> None:
    given = "meshes/" + "a" * 5000
    assert locate_file(given, tmp_path) == tmp_path / given
