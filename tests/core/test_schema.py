from __future__ import annotations

import dataclasses
import enum
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    Pose,
    dump_document,
    load_document,
    make_pose,
    parse_document,
    save_document,
)


class Shading(enum.Enum):
    FLAT = "flat"
    SMOOTH = "smooth"


@dataclass(frozen=True, kw_only=True)
class Part:
    name: str
    mass: float = 0.1
    X_SO: Pose = Pose()

    def __post_init__(self) -> None:
        if self.mass <= 0.0:
            raise InvalidInputError(f"mass is {self.mass:g} kg; it must be above 0")


@dataclass(frozen=True, kw_only=True)
class Document:
    version: int = 1
    name: str
    count: int = 3
    visible: bool = True
    model: Literal["point", "hydroelastic"] = "point"
    shading: Shading = Shading.SMOOTH
    size: tuple[float, float] = (0.5, 0.4)
    tags: list[str] = field(default_factory=list)
    parts: tuple[Part, ...] = ()
    by_name: dict[str, Part] = field(default_factory=dict)
    limit: float | None = None


FULL = Document(
    name="größe: # 'x'",
    count=-7,
    visible=False,
    model="hydroelastic",
    shading=Shading.FLAT,
    size=(0.1 + 0.2, 1e-300),
    tags=["true", "1.0", "null", "", "- a", "~", "two\nlines"],
    parts=(Part(name="1e3", mass=1e22), Part(name="b", X_SO=Pose((1.0, 2.0, 3.0)))),
    by_name={"yes": Part(name="c", X_SO=Pose(quaternion_wxyz=(0.5, -0.5, 0.5, 0.5)))},
    limit=2.5,
)


@pytest.mark.parametrize("document", [Document(name="a"), FULL])
def test_a_document_comes_back_as_it_was(tmp_path: Path, document: Document):
    save_document(document, tmp_path / "d.yaml", header="made by a test\nsecond line")
    assert (tmp_path / "d.yaml").read_text().startswith("# made by a test\n# second line\nversion")
    assert load_document(tmp_path / "d.yaml", Document) == document


def test_defaults_are_left_out_but_for_the_version():
    assert dump_document(Document(name="a", size=(0.1, 0.2))) == (
        "version: 1\nname: a\nsize: [0.1, 0.2]\n"
    )


def test_defaults_are_filled_in():
    assert parse_document("version: 1\nname: a\n", Document, "d") == Document(name="a")


def test_numpy_numbers_and_none_are_written_plainly():
    document = Document(name="a", count=np.int64(4), limit=np.float64(0.25))  # type: ignore
    assert dump_document(document) == "version: 1\nname: a\ncount: 4\nlimit: 0.25\n"


@pytest.mark.parametrize("number", ["5", "5.0", "+5.0e0", "'5'", "50e-1"])
def test_numbers_in_every_spelling(number):
    assert parse_document(f"version: 1\nname: a\nlimit: {number}\n", Document, "d").limit == 5.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "d.yaml: the document is empty; expected keys version, name, count, visible, model,"
             " shading, size, tags, parts, by_name, limit"),
        ("- 1\n", "d.yaml:1: expected keys with values ('key: value' lines)"),
        ("name: a\n", "d.yaml:1: version: missing; add 'version: 1'"),
        ("mug: 0.1\n", "d.yaml:1: not a document; one has the keys version, name"),
        ("version: 1\nmug: 0.1\n", "d.yaml:1: not a document; one has the keys version, name"),
        ("name: a\nversion: 3\n",
         "d.yaml:2: version: 3 cannot be read; this release reads version 1"),
        ("version: [1]\n",
         "d.yaml:1: version: a structure cannot be read; this release reads version 1"),
        ("version: 1\n", "d.yaml:1: key 'name' is missing"),
        ("version: 1\nname: a\nsizes: [1, 2]\n",
         "d.yaml:3: unknown key 'sizes'; did you mean 'size'? Known: by_name, count, limit, model,"
         " name, parts, shading, size, tags, version, visible"),
        ("version: 1\nname: a\nparts:\n- name: b\n  X_S0: {}\n",
         "d.yaml:5: parts[0]: unknown key 'X_S0'; did you mean 'X_SO'? Known: X_SO, mass, name"),
        ("version: 1\nname: a\nby_name:\n  b:\n    name: b\n    X_SO:\n      rpy: [0, 0, 0]\n",
         "d.yaml:7: by_name.b.X_SO: unknown key 'rpy'; did you mean 'rpy_deg'? Known:"
         " quaternion_wxyz, rpy_deg, translation"),
        ("version: 1\nname: a\nname: b\n", "d.yaml:3: key 'name' is given twice"),
        ("version: 1\n? [a, b]\n: c\n", "d.yaml:2: a key must be a text, not a list or a mapping"),
        ("version: 1\nname: a\ncount: 1.5\n", "d.yaml:3: count: '1.5' is not a whole number"),
        ("version: 1\nname: a\nlimit: .nan\n", "d.yaml:3: limit: '.nan' is not a finite number"),
        ("version: 1\nname: a\nlimit: nan\n", "d.yaml:3: limit: 'nan' is not a finite number"),
        ("version: 1\nname: a\nlimit: 1e999\n", "d.yaml:3: limit: '1e999' is not a finite number"),
        ("version: 1\nname: a\nlimit: [1]\n", "d.yaml:3: limit: expected a finite number"),
        ("version: 1\nname: a\nvisible: yes\n", "d.yaml:3: visible: 'yes' is not true or false"),
        ("version: 1\nname:\n", "d.yaml:2: name: expected a text"),
        ("version: 1\nname: {b: c}\n", "d.yaml:2: name: expected a text"),
        ("version: 1\nname: a\nsize: [1, 2, 3]\n", "d.yaml:3: size: has 3 entries; expected 2"),
        ("version: 1\nname: a\nsize: [1, x]\n", "d.yaml:3: size[1]: 'x' is not a finite number"),
        ("version: 1\nname: a\nsize: 1\n", "d.yaml:3: size: expected a list such as [a, b, c]"),
        ("version: 1\nname: a\nmodel: hydro\n",
         ("d.yaml:3: model: 'hydro' is not valid; did you mean 'hydroelastic'? Known:"
             " hydroelastic, point")),
        ("version: 1\nname: a\nshading: smoth\n",
         "d.yaml:3: shading: 'smoth' is not valid; did you mean 'smooth'? Known: flat, smooth"),
        ("version: 1\nname: a\nparts:\n- {name: b, mass: -1}\n",
         "d.yaml:4: parts[0]: mass is -1 kg; it must be above 0"),
        ("version: 1\nname: a\nparts:\n- name: b\n  X_SO: {rpy_deg: [0, 0, 0], "
         "quaternion_wxyz: [1, 0, 0, 0]}\n",
         "d.yaml:5: parts[0].X_SO: give rpy_deg or quaternion_wxyz, not both"),
        ("version: 1\nname: a\nparts:\n- name: b\n  X_SO: {quaternion_wxyz: [1, 1, 0, 0]}\n",
         "d.yaml:5: parts[0].X_SO: quaternion_wxyz has length 1.41421; a rotation has length 1"),
    ],
)  # fmt: skip
def test_messages_name_file_line_key_and_remedy(text, message):
    with pytest.raises(DocumentError) as caught:
        parse_document(text, Document, "d.yaml")
    assert str(caught.value) == message


def test_unreadable_files(tmp_path: Path):
    def message(path: Path) -> str:
        with pytest.raises(DocumentError) as caught:
            load_document(path, Document)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    path = tmp_path / "d.yaml"
    assert message(path) == f"cannot read {path}: No such file or directory"
    assert message(tmp_path) == f"cannot read {tmp_path}: it is a folder; expected a file"
    path.write_bytes(b"\xff\xfe\x00")
    assert message(path) == f"cannot read {path}: it is not a text file"
    for broken in (
        "version: 1\nname: [a\n",
        "a: 'x\n",
        "\ta: 1\n",
        "a: 1\n---\nb: 2\n",
        "a: \x01\n",
    ):
        path.write_text(broken)
        assert message(path).startswith(f"{path}") and ": not valid YAML: " in message(path)


def test_a_failed_save_keeps_the_old_document(tmp_path: Path):
    path = tmp_path / "d.yaml"
    save_document(Document(name="old"), path)
    with pytest.raises(Exception, match="cannot represent"):
        save_document(dataclasses.replace(FULL, name=object()), path)  # type: ignore[arg-type]
    assert load_document(path, Document).name == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_pose_matrix_is_rz_ry_rx_in_degrees():
    X = Pose((1.0, 2.0, 3.0), rpy_deg=(0.0, 0.0, 90.0)).matrix()
    np.testing.assert_allclose(X[:3], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]], atol=1e-15)
    X = Pose(rpy_deg=(90.0, 0.0, 90.0)).matrix()  # first about x, then about the fixed z
    np.testing.assert_allclose(X[:3, :3] @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(X[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_pose_quaternion_is_wxyz():
    half = np.sqrt(0.5)
    X = Pose(quaternion_wxyz=(half, 0.0, 0.0, half)).matrix()
    np.testing.assert_allclose(X, Pose(rpy_deg=(0.0, 0.0, 90.0)).matrix(), atol=1e-15)


@pytest.mark.parametrize("quaternion", [False, True])
def test_poses_survive_the_way_through_text(quaternion):
    rotations = Rotation.random(30, random_state=1).as_matrix()
    rotations = [*rotations, Pose(rpy_deg=(20.0, 90.0, 50.0)).matrix()[:3, :3]]
    for R in rotations:
        X = make_pose(R, [0.1, -1e-17, 3.0])
        part = Part(name="a", X_SO=Pose.from_matrix(X, quaternion=quaternion))
        text = dump_document(Document(name="d", parts=(part,)))
        back = parse_document(text, Document, "d").parts[0].X_SO
        np.testing.assert_allclose(back.matrix(), X, atol=1e-14 if quaternion else 1e-8)
