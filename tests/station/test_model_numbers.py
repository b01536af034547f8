"""Numbers of SDF and URDF that Drake takes on trust are refused, with file, line, link or joint."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import InvalidInputError, builtin_names, data_root, resolve_reference
from burg_drake.station import add_robot, check_hand, load_hand, load_station, require_valid_numbers

SDF = """\
<sdf version="1.9"><model name="m">
  <link name="base"/>
  <link name="slide">
    <inertial><pose>0 0 0 0 0 0</pose><mass>0.2</mass>
      <inertia><ixx>2e-5</ixx><iyy>2e-5</iyy><izz>4e-5</izz><ixy>0</ixy></inertia></inertial>
    <collision name="pad"><pose>0 0 0.1 0 0 0</pose><geometry><box><size>.1 .2 .3</size></box>
      </geometry>
      <drake:proximity_properties>
        <drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>
        <drake:mu_static>0.5</drake:mu_static>
      </drake:proximity_properties></collision>
  </link>
  <joint name="rail" type="prismatic"><parent>base</parent><child>slide</child>
    <axis><xyz>1 0 0</xyz><dynamics><damping>0.1</damping></dynamics>
      <limit><lower>0</lower><upper>0.1</upper><effort>-1</effort><velocity>-1</velocity></limit>
    </axis></joint>
</model></sdf>
"""
URDF = """\
<robot name="m">
  <link name="base"/>
  <link name="arm">
    <inertial><origin xyz="0 0 0.1"/><mass value="2"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision name="tube"><origin xyz="0 0 0.1" rpy="0 0 0"/>
      <geometry><cylinder radius="0.1" length="0.2"/></geometry>
      <drake:proximity_properties><drake:mu_static value="0.5"/></drake:proximity_properties>
    </collision>
  </link>
  <link name="tool"><inertial><mass value="0"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/>
    <dynamics damping="0.1"/></joint>
  <joint name="hold" type="fixed"><parent link="arm"/><child link="tool"/></joint>
  <transmission name="drive"><actuator name="motor">
    <drake:rotor_inertia value="1e-3"/><drake:gear_ratio value="100"/></actuator></transmission>
  <gazebo><plugin name="other"><velocity>none</velocity></plugin></gazebo>
</robot>
"""


def found_wrong(folder: Path, text: str) -> str:
    """What is said of a model; empty if nothing is."""
    path = folder / ("m.urdf" if "<robot" in text else "m.sdf")
    path.write_text(text, encoding="utf-8")
    try:
        require_valid_numbers(path)
    except InvalidInputError as error:
        return str(error).removeprefix(f"{path}:")
    return ""


@pytest.mark.parametrize("text", [SDF, URDF], ids=["sdf", "urdf"])
def test_sound_models_pass(tmp_path: Path, text: str) -> None:
    assert found_wrong(tmp_path, text) == ""


def test_a_changed_model_is_checked_again(tmp_path: Path) -> None:
    wrong = SDF.replace("<mass>0.2<", "<mass>nan<")
    assert [bool(found_wrong(tmp_path, text)) for text in (SDF, wrong, SDF, wrong)] == [0, 1, 0, 1]


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "-0.5", "abc"])
@pytest.mark.parametrize(
    "old, key",
    [
        ("<mass>0.2<", "mass"),
        ("<ixx>2e-5<", "ixx"),
        (">.1 .2 .3<", "size"),
        (">1e7<", "hydroelastic_modulus"),
        ("static>0.5<", "mu_static"),
        (">0.1</damping", "damping"),
        ('mass value="2"', "mass"),
        ('iyy="0.02"', "iyy"),
        ('radius="0.1"', "radius"),
        ('mu_static value="0.5"', "mu_static"),
        ('effort="10"', "effort"),
        ('velocity="2"', "velocity"),
        ('damping="0.1"', "damping"),
        ('rotor_inertia value="1e-3"', "rotor_inertia"),
    ],
)
def test_what_no_body_has(tmp_path: Path, old: str, key: str, number: str) -> None:
    (text,) = (text for text in (SDF, URDF) if old in text)
    last = re.findall(r"[\d.][\d.e-]*", old)[-1]
    said = found_wrong(tmp_path, text.replace(old, number.join(old.rsplit(last, 1)), 1))
    moments = "inertia has the principal moments -0.5, "
    assert f": {key} is " in said or (number == "-0.5" and moments in said)
    assert number in said
    line = text[: text.index(old)].count("\n") + 1
    assert abs(int(said.partition(":")[0]) - line) <= 1
    assert re.search(r"(link '(slide|arm)'|joint '(rail|turn)'|transmission 'drive')", said)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("<mass>0.2<", "<mass>0<", "4: link 'slide': mass is 0; it must be above 0 unless"),
        ("<pose>0 0 0.1", "<pose>nan 0 0.1", "6: link 'slide', collision 'pad': pose is nan 0 0.1"),
        (">1 0 0</xyz", ">0 0 0</xyz", "14: joint 'rail': axis is 0 0 0; it must be a direction"),
        ("<lower>0<", "<lower>nan<", "15: joint 'rail': lower is nan; it must be a number, or"),
        ("<upper>0.1<", "<upper>-0.1<", "15: joint 'rail': lower is 0, which is above upper, -0.1"),
        ("<effort>-1<", "<effort>nan<", "15: joint 'rail': effort is nan; it must be a number"),
        (">4e-5<", ">4.1e-5<", "4: link 'slide': inertia has the principal moments 2e-05, 2e-05, "),
        (">4e-5<", ">0<", ""),  # a thin rod
        ("<ixy>0<", "<ixy>2.1e-5<", "4: link 'slide': inertia has the principal moments -1e-06, "),
        ('xyz="0 0 1"', 'xyz="0 0 0"', "14: joint 'turn': axis is 0 0 0"),
        ('lower="-1"', 'lower="1.5"', "14: joint 'turn': lower is 1.5, which is above upper, 1"),
        ('ratio value="100"', 'ratio value="0"', "18: transmission 'drive': gear_ratio is 0"),
        ('type="fixed"', 'type="continuous"', "11: link 'tool': mass is 0"),
    ],
)
def test_messages(tmp_path: Path, old: str, new: str, message: str) -> None:
    (text,) = (text for text in (SDF, URDF) if old in text)
    said = found_wrong(tmp_path, text.replace(old, new))
    assert said.startswith(message) and bool(said) == bool(message)


MASSLESS = {
    SDF: "<inertial><mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>",
    URDF: '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>',
}


@pytest.mark.parametrize("text", [SDF, URDF], ids=["sdf", "urdf"])
def test_a_root_link_needs_no_mass(tmp_path: Path, text: str) -> None:
    """The station welds it; without joints it is the only link, and free."""
    link = f'<link name="base">{MASSLESS[text]}</inertial></link>'
    assert found_wrong(tmp_path, text.replace('<link name="base"/>', link)) == ""
    alone = re.sub(r'<link name="base"/>.*(?=</model|</robot)', link, text, flags=re.DOTALL)
    assert "link 'base': mass is 0; it must be above 0 unless" in found_wrong(tmp_path, alone)


def test_a_hand_whose_body_has_no_mass(tmp_path: Path) -> None:
    source = data_root() / "models/panda"
    text = (source / "panda_hand.sdf").read_text(encoding="utf-8")
    text = text.replace("meshes/", f"{source}/meshes/")
    (tmp_path / "hand.sdf").write_text(
        re.sub(r"<inertial>.*?(?=</inertial>)", MASSLESS[SDF], text, count=1, flags=re.DOTALL)
    )
    hand = load_hand("panda_hand")
    massive = check_hand(hand, source / "panda_hand.sdf")
    assert check_hand(hand, tmp_path / "hand.sdf") == massive


def test_an_inertia_outside_of_links_is_left_to_drake(tmp_path: Path) -> None:
    inertial = "<inertial><mass>0</mass></inertial>"
    assert found_wrong(tmp_path, SDF.replace('<link name="base"/>', inertial, 1)) == ""


@pytest.mark.parametrize("depth", [200, 201, 3_000])
def test_deeply_nested_elements(tmp_path: Path, depth: int) -> None:
    said = found_wrong(tmp_path, "<sdf>\n" + (depth - 1) * "<a>" + (depth - 1) * "</a>" + "</sdf>")
    assert said == ("" if depth == 200 else "2: more than 200 nested elements")


@pytest.mark.parametrize("name", builtin_names("models/hands"))
def test_built_in_hands_are_sound(name: str) -> None:
    require_valid_numbers(resolve_reference(load_hand(name).model))


def test_what_a_model_includes_is_checked(tmp_path: Path) -> None:
    """By way of the station, whose arm is an SDF that includes another."""
    (tmp_path / "m.sdf").write_text(SDF.replace("<mass>0.2<", "<mass>nan<"), encoding="utf-8")
    (tmp_path / "outer.sdf").write_text(
        '<sdf version="1.9"><model name="o"><include><uri>m.sdf</uri></include></model></sdf>'
    )
    station = replace(load_station("panda_tabletop"), arm_model=tmp_path / "outer.sdf")
    with pytest.raises(InvalidInputError, match=r"m\.sdf:4: link 'slide': mass is nan; it must"):
        add_robot(RobotDiagramBuilder(time_step=0.001), station, "arm")


def test_hand_check_refuses_it(tmp_path: Path) -> None:
    source = data_root() / "models/panda"
    text = (source / "panda_hand.sdf").read_text(encoding="utf-8")
    text = text.replace("meshes/", f"{source}/meshes/").replace("<mass>0.015<", "<mass>nan<")
    (tmp_path / "hand.sdf").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInputError) as error:
        check_hand(load_hand("panda_hand"), tmp_path / "hand.sdf")
    line = text[: text.index("<mass>nan<")].count("\n") + 1
    assert str(error.value) == (
        f"{tmp_path}/hand.sdf:{line}: link 'panda_leftfinger': mass is nan; it must be finite and"
        " at least 0"
    )
