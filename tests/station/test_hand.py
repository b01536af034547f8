"""The gripper document."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from burg_drake.core import (
    BurgError,
    DocumentError,
    InvalidInputError,
    Pose,
    UnknownNameError,
    builtin_names,
    make_pose,
    resolve_reference,
    rotation_from_rpy,
)
from burg_drake.station import (
    Finger,
    Hand,
    add_hand,
    add_robot,
    check_hand,
    load_hand,
    load_station,
    locate_hand,
)
from tests.pages import ROOT

STUCK = Finger(body="a", joint="j", pad="pad", closed=0.02, open=0.02)
MOVING = replace(STUCK, open=0.03)


@pytest.fixture(scope="module")
def panda() -> Hand:
    return load_hand("panda_hand")


def test_grasp_frame_of_the_panda_hand(panda: Hand) -> None:
    """TCP 0.1034 m in front of the hand; its fingers move along y of the hand, x of G."""
    X_HG = panda.X_HG.matrix()
    np.testing.assert_allclose(X_HG[:3, 3], (0.0, 0.0, 0.1034))
    np.testing.assert_allclose(X_HG[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert panda.opening == (0.0, 0.08)
    assert sum(f.open - f.closed for f in panda.fingers) == pytest.approx(panda.opening[1])


def test_hand_poses_bring_the_grasp_frame_to_the_goal(panda: Hand) -> None:
    rng = np.random.default_rng(0)
    X_WG = make_pose(rotation_from_rpy(rng.uniform(-3, 3, (20, 3))), rng.normal(size=(20, 3)))
    X_WH = panda.X_AH(X_WG)
    np.testing.assert_allclose(X_WH @ panda.X_HG.matrix(), X_WG, atol=1e-14)
    # The TCP is in front of the hand, along the approach direction.
    tcp = X_WH[:, :3, 3] + 0.1034 * X_WG[:, :3, 2]
    np.testing.assert_allclose(tcp, X_WG[:, :3, 3], atol=1e-14)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            {"opening": (0.08, 0.0)},
            (
                r"opening \[0.08, 0.0\] must be two distances in metres, the smaller one first"
                r" and at least 0"
            ),
        ),
        (
            {"opening": (-0.01, 0.08)},
            (
                r"opening \[-0.01, 0.08\] must be two distances in metres, the smaller one"
                r" first and at least 0"
            ),
        ),
        ({"force": 0.0}, "force is 0 N; it must be above 0"),
        ({"closing_speed": -0.05}, "closing_speed is -0.05 m/s; it must be above 0"),
        ({"fingers": (STUCK, STUCK)}, "finger 'a': closed and open must differ; both are 0.02 m"),
        ({"fingers": (MOVING, MOVING)}, "both fingers name the same body, 'a'"),
        ({"fingers": (MOVING, replace(MOVING, body="b"))}, "both fingers name the same joint, 'j'"),
    ],
)
def test_bad_figures(panda: Hand, wrong: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        replace(panda, **wrong)  # type: ignore[arg-type]


def test_unknown_key_and_name(tmp_path: Path) -> None:
    text = resolve_reference("panda_hand", "models/hands").read_text(encoding="utf-8")
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace("closing_speed:", "closing_sped:"), encoding="utf-8")
    with pytest.raises(DocumentError, match=r"mine\.yaml:\d+: .*'closing_sped'.*'closing_s"):
        load_hand(str(file))
    with pytest.raises(UnknownNameError, match=r"pandahand .*did you mean 'panda_hand'"):
        load_hand("pandahand")


@pytest.mark.parametrize("name", builtin_names("models/hands"))
def test_built_in_hands_fit_their_models(name: str) -> None:
    hand = load_hand(name)
    assert hand.name == name
    assert check_hand(hand, resolve_reference(hand.model)).opening == pytest.approx(
        hand.opening, abs=1e-9
    )


def one_finger(hand: Hand, index: int = 1, **changed: object) -> Hand:
    """The hand with one finger's entries changed."""
    fingers = list(hand.fingers)
    fingers[index] = replace(fingers[index], **changed)  # type: ignore[arg-type]
    return replace(hand, fingers=(fingers[0], fingers[1]))


WRONG_DOCUMENTS = {
    "body": (
        lambda h: replace(h, body="panda_hnd"),
        "body 'panda_hnd' is not in its model package://burg_drake/models/panda/panda_hand.sdf; did"
        " you mean 'panda_hand'? Known: panda_hand, panda_leftfinger, panda_rightfinger",
    ),
    "finger": (
        lambda h: one_finger(h, body="finger"),
        "fingers[1].body 'finger' is not in its model",
    ),
    "joint": (
        lambda h: one_finger(h, joint="panda_finger_joint3"),
        "fingers[1].joint 'panda_finger_joint3' is not in its model"
        " package://burg_drake/models/panda/panda_hand.sdf; did you mean 'panda_finger_joint2'?"
        " Known: panda_finger_joint1, panda_finger_joint2",
    ),
    "pad": (
        lambda h: one_finger(h, index=0, pad="pda"),
        "fingers[0].pad 'pda' is not in its model package://burg_drake/models/panda/panda_hand.sdf;"
        " did you mean 'pad'? Known: diagonal, pad, screw_mount, sledge",
    ),
    "limits": (
        lambda h: one_finger(h, open=0.05),
        "fingers[1].open is 0.05 m, but joint 'panda_finger_joint2' goes from 0 to 0.04 m",
    ),
    "opening": (
        lambda h: replace(h, opening=(0.0, 0.1)),
        "with both fingers open the pads are 80.0 mm apart along x of G, but opening says 100.0 mm",
    ),
    "closed": (
        lambda h: one_finger(h, closed=0.002),
        "with both fingers closed the pads are 2.0 mm apart along x of G, but opening says 0.0 mm",
    ),
    "swapped": (
        lambda h: replace(h, fingers=h.fingers[::-1]),
        "the first finger is on the side of -x of G; exchange the fingers, or turn X_HG by 180 deg",
    ),
    "turned": (
        lambda h: replace(h, X_HG=Pose((0.0, 0.0, 0.1034))),
        "x of G is not the closing direction: the fingers open along (0.00, 1.00, 0.00) of G; turn"
        " X_HG",
    ),
    "aside": (
        lambda h: replace(h, X_HG=Pose((0.0, 0.003, 0.1034), rpy_deg=(0.0, 0.0, 90.0))),
        "with both fingers open the middle between the pads is at x = -3.0 mm of G",
    ),
    "short": (
        lambda h: replace(h, X_HG=Pose((0.0, 0.0, 0.09), rpy_deg=(0.0, 0.0, 90.0))),
        "G is not between the pads: with both fingers open the pad of fingers[0] reaches from"
        " 4.4 mm to 22.9 mm along z of G",
    ),
    "upside down": (
        lambda h: replace(h, X_HG=Pose((0.0, 0.0, 0.1034), rpy_deg=(180.0, 0.0, 90.0))),
        "+z of G, the approach direction, points towards 'panda_hand'; turn X_HG",
    ),
    "force": (
        lambda h: replace(h, force=80.0),
        "force is 80 N, but the effort limit of joint 'panda_finger_joint1' in",
    ),
    "speed": (
        lambda h: replace(h, closing_speed=0.1),
        "closing_speed is 0.1 m/s, but the velocity limit of joint 'panda_finger_joint1' in",
    ),
    "uncoupled": (
        lambda h: replace(h, coupled=False),
        "coupled is false, but in the model one finger follows the other",
    ),
}


@pytest.mark.parametrize("wrong", WRONG_DOCUMENTS)
def test_document_that_does_not_fit_its_model(panda: Hand, wrong: str) -> None:
    change, message = WRONG_DOCUMENTS[wrong]
    with pytest.raises(InvalidInputError) as error:
        check_hand(change(panda), resolve_reference(panda.model))
    assert str(error.value).startswith("hand 'panda_hand': " + message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("force: 30.0", "force: -30", "15: force is -30 N; it must be above 0"),
        (
            "[0.0, 0.11]",
            "[0.11, 0.0]",
            (
                "14: opening [0.11, 0.0] must be two distances in metres, the smaller one"
                " first and at least 0"
            ),
        ),
        (
            "wsg_right_joint",
            "wsg_left_joint",
            "21: both fingers name the same joint, 'wsg_left_joint'",
        ),
        (
            "wsg_right_finger",
            "wsg_left_finger",
            "21: both fingers name the same body, 'wsg_left_finger'",
        ),
        (
            "open: 0.055",
            "open: 0.0",
            "20: finger 'wsg_left_finger': closed and open must differ; both are 0 m",
        ),
        ("/wsg_50.sdf", "/wsg.sdf", " model: package://burg_drake/models/wsg/wsg.sdf does not"),
        (
            "{translation: [0.0, 0.0, 0.1455]}",
            "{translation: [0.0, 0.0, 0.1455], rpy_deg: [0, 0, 90]}",
            " hand 'wsg_50': x of G is not the closing direction: the fingers open along"
            " (0.00, -1.00, 0.00) of G; turn X_HG (package://burg_drake/models/wsg/wsg_50.sdf)",
        ),
        (
            "[0.0, 0.11]",
            "[0.0, 0.1]",
            " hand 'wsg_50': with both fingers open the pads are 110.0 mm apart along x of G, but",
        ),
    ],
)
def test_the_file_is_named_through_a_station_too(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    text = resolve_reference("wsg_50", "models/hands").read_text(encoding="utf-8")
    assert text.count(old) == 1
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "station.yaml").write_text("version: 1\nname: bare\nhand: mine.yaml\n")
    with pytest.raises(BurgError) as error:
        hand, model, path = locate_hand(str(file))
        check_hand(hand, model, path)
    assert str(error.value).startswith(f"{file}:{message}")
    with pytest.raises(BurgError) as other:
        station = load_station(tmp_path / "station.yaml")
        add_robot(RobotDiagramBuilder(time_step=0.001), station, "hand")
    assert str(other.value).endswith(str(error.value))


MIMIC = '<drake:mimic joint="panda_finger_joint1" multiplier="1" offset="0"/>'
COMPLIANT = "<drake:compliant_hydroelastic/>"
LOOSE_LINK = """
    <link name="camera"/><joint name="tilt" type="revolute"><parent>panda_hand</parent>
    <child>camera</child><axis><xyz>0 0 1</xyz></axis></joint>
    <drake:collision_filter_group"""


def changed_model(folder: Path, old: str, new: str) -> Path:
    """The Panda hand's model with other text in it."""
    path = resolve_reference("package://burg_drake/models/panda/panda_hand.sdf")
    text = path.read_text(encoding="utf-8")
    assert old in text
    text = text.replace("meshes/", f"{path.parent}/meshes/").replace(old, new)
    (folder / "hand.sdf").write_text(text, encoding="utf-8")
    return folder / "hand.sdf"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            MIMIC,
            MIMIC.replace('"1"', '"0.5"'),
            "the mimic joint of the model moves the fingers in another",
        ),
        (
            MIMIC,
            MIMIC.replace('"1"', '"-1"'),
            "the mimic joint of the model moves the fingers in another",
        ),
        (COMPLIANT, "", r"fingers\[0\].pad 'pad' is not compliant; give it drake:compliant_hydroe"),
        (COMPLIANT, "<drake:rigid_hydroelastic/>", r"fingers\[0\].pad 'pad' is not compliant"),
        ('name="pad"', 'name="tip"', r"fingers\[0\].pad 'pad' is not in its model"),
        (
            "    <drake:collision_filter_group",
            LOOSE_LINK,
            "actuators for panda_finger_joint1, ",
        ),
        (
            "    <drake:collision_filter_group",
            LOOSE_LINK.replace("<parent>panda_hand<", "<parent>world<"),
            "joint 'tilt' fixes 'camera' to the world; remove it",
        ),
        ("<sdf ", "<sfd ", "cannot be loaded as one model"),
        (
            'name="panda_finger_joint2" type="prismatic"',
            'name="panda_finger_joint2" type="revolute"',
            r"fingers\[1\].joint 'panda_finger_joint2' is revolute in its model package://.*;"
            " fingers have to be on prismatic joints: model a hand whose fingers turn by two",
        ),
    ],
)
def test_model_that_does_not_fit(
    panda: Hand,
    tmp_path: Path,
    old: str,
    new: str,
    message: str,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_hand(panda, changed_model(tmp_path, old, new))
    assert capfd.readouterr().err == "" and caplog.text == ""


@pytest.mark.parametrize("coupled", [True, False])
def test_the_document_couples_what_the_model_leaves_free(
    panda: Hand, tmp_path: Path, coupled: bool
) -> None:
    """Two fingers of one mass share the momentum that one of them is given; or it keeps it."""
    hand = replace(panda, coupled=coupled)
    path = changed_model(tmp_path, MIMIC, "")
    check_hand(hand, path)
    builder = RobotDiagramBuilder(time_step=0.001)
    plant = builder.plant()
    found = add_hand(builder, hand, path)
    plant.WeldFrames(plant.world_frame(), found.body.body_frame())
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for joint, rate in zip(found.joints, (0.02, 0.0), strict=True):
        joint.set_translation(context, 0.01)
        joint.set_translation_rate(context, rate)
    simulator.AdvanceTo(0.1)
    moved = [joint.get_translation(context) - 0.01 for joint in found.joints]
    assert moved == pytest.approx([0.001, 0.001] if coupled else [0.002, 0.0], abs=5e-5)


def test_depth_of_pads_on_cranks() -> None:
    """The page's table of a Robotiq 2F-85, by the cranks of MuJoCo Menagerie's: 37 mm to the side
    and 44 mm forward with the hand open, the middle of the pads 141.5 mm before the flange."""
    rows = [
        [float(cell) for cell in re.findall(r"\| ([\d.]+)", line)]
        for line in (ROOT / "docs/reference/hands.md").read_text("utf-8").splitlines()
        if line.startswith(("| opening [mm]", "| middle of the pads"))
    ]
    opening, depth = np.array(rows)
    side = 37.0 - (85.0 - opening) / 2.0
    forward = np.sqrt(37.0**2 + 44.0**2 - side**2)
    np.testing.assert_allclose(depth, 141.5 + forward - 44.0, atol=0.1)
