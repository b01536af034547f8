"""The statics of a grip hold for any hand that a document describes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trial_world import BOX_MASS, GRAVITY, SLOW, WIDE, from_above

from burg_drake.core import Outcome, Pose, resolve_reference, swap_fingers
from burg_drake.grasping import AntipodalSettings, sample_antipodal
from burg_drake.scene import Board, Instance, SceneDocument, load_scene, save_scene
from burg_drake.simulation import HandTrial, MujocoTrial, TrialSettings, hand_trial_of
from burg_drake.station import Station, StationDocument, Table, load_hand
from tests.pages import ROOT

NORMAL = TrialSettings()


@dataclass(frozen=True)
class Case:
    """A hand and what its data sheet says.

    Attributes:
        reference: hand document.
        force: of each finger [N].
        pad: extents of a pad's face [m].
        widest: opening [m].
    """

    reference: str
    force: float
    pad: tuple[float, float]
    widest: float


HANDS = {
    "wsg": Case("wsg_50", 30.0, (0.020, 0.020), 0.11),
}

OWN_SDF = """\
<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="pincer">
  <link name="base"><collision name="block">
    <pose>0 -0.1 0 0 0 0</pose><geometry><box><size>0.1 0.02 0.14</size></box></geometry>
  </collision></link>
{fingers}</model></sdf>
"""
OWN_FINGER = """\
  <link name="{name}"><pose relative_to="slide_{name}"/>
    <inertial><mass>0.05</mass><inertia><ixx>1e-5</ixx><iyy>1e-5</iyy><izz>1e-5</izz></inertia>
    </inertial>
    <collision name="rubber">
      <geometry><box><size>0.02 0.02 0.01</size></box></geometry>
      <drake:proximity_properties><drake:compliant_hydroelastic/>
        <drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>
        <drake:hunt_crossley_dissipation>5</drake:hunt_crossley_dissipation>
      </drake:proximity_properties></collision></link>
  <joint name="slide_{name}" type="prismatic"><parent>base</parent><child>{name}</child>
    <pose relative_to="base">0 0 {offset} 0 0 0</pose>
    <axis><xyz>0 0 -1</xyz><limit><lower>-0.05</lower><upper>0.05</upper><effort>25</effort></limit>
    </axis></joint>
"""
OWN_DOCUMENT = """\
version: 1
name: pincer
model: pincer.sdf
body: base
X_HG: {translation: [0, 0, 0], quaternion_wxyz: [0.5, -0.5, -0.5, -0.5]}
opening: [0.004, 0.084]
force: 25
closing_speed: 0.1
fingers:
  - {body: b, joint: slide_b, pad: rubber, closed: 0.045, open: 0.005}
  - {body: a, joint: slide_a, pad: rubber, closed: 0.01, open: 0.05}
"""
"""A hand that approaches along y of H and closes along z. Its fingers are named the other way round
than they stand in the model, their joints do not start at 0, and nothing couples them there."""


@pytest.fixture(scope="module", params=[*HANDS, "own", "uncoupled", "linkage"])
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    if request.param in HANDS:
        return HANDS[request.param]
    folder = tmp_path_factory.mktemp("own")
    if request.param == "linkage":  # fingers that turn, as the example has them: two that slide
        document = ROOT / "examples" / "robotiq_2f85" / "robotiq_2f85.yaml"
        return Case(str(document), 60.0, (0.022, 0.0375), 0.085)
    fingers = OWN_FINGER.format(name="a", offset=0.003)
    fingers += OWN_FINGER.format(name="b", offset=0.052)
    (folder / "pincer.sdf").write_text(OWN_SDF.format(fingers=fingers), encoding="utf-8")
    document = OWN_DOCUMENT + ("coupled: false\n" if request.param == "uncoupled" else "")
    (folder / "pincer.yaml").write_text(document, encoding="utf-8")
    return Case(str(folder / "pincer.yaml"), 25.0, (0.02, 0.02), 0.084)


@pytest.fixture(scope="module", params=["screening", "mujoco"])
def make_trial(
    request: pytest.FixtureRequest, library: Path, tmp_path_factory: pytest.TempPathFactory
):
    """Makes the trial of one object under a hand, with Drake or MuJoCo."""
    if request.param == "mujoco":
        pytest.importorskip("mujoco")

    def make(
        hand: str,
        name: str = "box",
        X_WS: Pose = Pose(),
        settings: TrialSettings = NORMAL,
    ) -> HandTrial | MujocoTrial:
        path = tmp_path_factory.mktemp("scene") / "scene.yaml"
        instance = Instance(object=name, X_SO=Pose((0.3, 0.2, 0.0)))
        save_scene(
            SceneDocument(
                name="test",
                library=str(library),
                board=Board(size=(0.6, 0.4)),
                instances=(instance,),
            ),
            path,
        )
        return hand_trial_of(
            load_scene(path), make_station(hand, X_WS), request.param, settings=settings
        )

    return make


def make_station(reference: str, X_WS: Pose = Pose()) -> Station:
    """A hand over a large table, without an arm."""
    hand = load_hand(reference)
    table = Table(center=(0.3, 0.2), size=(3.0, 3.0, 0.1))
    document = StationDocument(name="test", hand=reference, X_WS=X_WS, table=table)
    base = Path(reference).parent
    return Station(
        document, hand, resolve_reference(hand.model, base=base), None, Path("test.yaml")
    )


CENTRE = from_above(0.05)
GRASPS = [
    CENTRE,
    from_above(0.06, y=0.01, yaw=0.1),
    from_above(0.065, y=0.035),
]


@pytest.fixture(scope="module")
def trial(case: Case, make_trial) -> HandTrial | MujocoTrial:
    return make_trial(case.reference)


def test_pads_press_with_the_commanded_force_and_their_whole_faces(
    case: Case, trial: HandTrial | MujocoTrial
) -> None:
    result = trial.run("box", CENTRE, friction=0.5)
    assert result.outcome is Outcome.LIFTED
    assert result.margins.pad_force == pytest.approx(case.force, rel=0.01)
    assert result.margins.patch_area == pytest.approx(case.pad[0] * case.pad[1], rel=0.01)
    assert result.margins.slip < 5e-4 and result.margins.tilt < np.deg2rad(0.1)


def test_coulomb_limit(case: Case, make_trial) -> None:
    """Two pads carry 2 mu N; the box weighs m g."""
    trial = make_trial(case.reference, settings=SLOW)
    limit = BOX_MASS * GRAVITY / (2 * case.force)
    assert trial.run("box", CENTRE, friction=0.97 * limit).outcome is Outcome.SLIPPED
    assert trial.run("box", CENTRE, friction=1.03 * limit).outcome is Outcome.LIFTED


def test_same_verdict_with_fingers_swapped_and_world_turned(
    case: Case, trial: HandTrial | MujocoTrial, make_trial
) -> None:
    turned = make_trial(case.reference, X_WS=Pose((0.4, -0.1, 0.0), rpy_deg=(0.0, 0.0, 37.0)))
    for X_OG in GRASPS:
        one = trial.run("box", X_OG, friction=0.17)
        for other in (
            trial.run("box", swap_fingers(X_OG), friction=0.17),
            turned.run("box", X_OG, friction=0.17),
        ):
            assert other.outcome is one.outcome
            assert other.margins.tilt == pytest.approx(one.margins.tilt, abs=np.deg2rad(1.0))
            assert other.margins.slip == pytest.approx(one.margins.slip, abs=2e-4)


def test_a_box_that_is_too_wide_for_the_others_is_for_the_wide_hand(
    case: Case, make_trial, library: Path
) -> None:
    trial = make_trial(case.reference, "wide")
    mesh = trimesh.creation.box(WIDE, trimesh.transformations.translation_matrix((0, 0, 0.05)))
    opening = trial.diagram.station.hand.opening
    assert opening[1] == case.widest
    sampled = sample_antipodal(
        mesh, 20, np.random.default_rng(0), AntipodalSettings(opening=opening)
    )
    result = trial.run("wide", from_above(0.08), friction=0.5)
    if case.widest > WIDE[0]:
        assert len(sampled) == 20 and sampled.width.max() < case.widest
        assert result.outcome is Outcome.LIFTED
    else:
        assert len(sampled) == 0
        assert result.outcome is Outcome.COLLISION_TARGET
