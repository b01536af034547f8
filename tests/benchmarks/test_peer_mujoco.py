"""Trials on MuJoCo against statics: they hold up to Coulomb's limit, and not beyond."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core.arrays import Array
from burg_drake.core.documents.schema import Pose
from burg_drake.core.frames import grasp_from_axes
from burg_drake.core.grasps.outcome import Outcome
from burg_drake.pipeline.build import build_library
from burg_drake.pipeline.source import ObjectSource
from burg_drake.scene.document.scene import (
    Board,
    Instance,
    SceneDocument,
    load_scene,
    save_scene,
)
from burg_drake.simulation.trials.trial_settings import DEFAULT_TRIAL
from burg_drake.station.document.station_document import load_station

mujoco = pytest.importorskip("mujoco")

from peer_mujoco import Peer, combined  # noqa: E402

GRAVITY, FORCE, TABLE_FRICTION = 9.81, 40.0, 0.5
PAD = (0.0175, 0.0185)
"""Front of a pad: across the finger and along it [m]."""
PAD_STIFFNESS = 1e7 / (0.0152 / 2)
"""Modulus over half the thickness [N/m^3]."""
MASSES = {"box": 0.3, "bar": 0.2}
"""Of the objects [kg]."""
SIZES = {"box": (0.06, 0.09, 0.08), "bar": (0.03, 0.30, 0.04)}
"""They close along x [m]."""
BESIDE = 0.4
"""From the box to the bar along x [m]."""
LEVER = 0.04
"""From the bar's middle to where it is gripped [m]."""


def from_above(z: float, y: float = 0.0) -> Array:
    """Grasp (4, 4) that closes along x."""
    return grasp_from_axes((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, y, z))


@pytest.fixture(scope="module")
def peer(measured_once: None, tmp_path_factory: pytest.TempPathFactory) -> Peer:
    """Box and bar side by side, far apart."""
    folder = tmp_path_factory.mktemp("library")
    sources = [
        ObjectSource(name=name, mesh=trimesh.creation.box(size), mass=MASSES[name])
        for name, size in SIZES.items()
    ]
    assert not build_library(sources, folder, confirm=False).failed
    placed = tuple(
        Instance(object=name, X_SO=Pose((BESIDE * k, 0.0, SIZES[name][2] / 2)))
        for k, name in enumerate(SIZES)
    )
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    document = SceneDocument(
        name="test", library=str(folder), board=Board(size=(0.6, 0.4)), instances=placed
    )
    save_scene(document, path)
    return Peer(load_scene(path), load_station("panda_tabletop"))


CENTER = from_above(0.01)
LOAD = GRAVITY + DEFAULT_TRIAL.acceleration
"""Weight and inertia of a mass while the hand accelerates [m/s^2]."""
LIMIT = MASSES["box"] * LOAD / (2 * FORCE)
"""Smallest friction with which the pads lift the box."""


def test_holds_up_to_coulombs_limit(peer: Peer) -> None:
    assert peer.run("box", CENTER, friction=0.98 * LIMIT) is Outcome.SLIPPED
    assert peer.run("box", CENTER, friction=1.02 * LIMIT) is Outcome.LIFTED
    risen = peer.data.body("box").xpos[2] - SIZES["box"][2] / 2
    assert risen == pytest.approx(peer.data.joint("hand lift").qpos[0], abs=1e-4)


def test_pads_press_as_hard_and_are_as_stiff_as_drakes(peer: Peer) -> None:
    assert peer.run("box", CENTER).held
    forces, wrench = {"panda_leftfinger": 0.0, "panda_rightfinger": 0.0}, np.zeros(6)
    for k, contact in enumerate(peer.data.contact):
        names = {peer.model.body(peer.model.geom_bodyid[g]).name for g in contact.geom}
        for finger in names & forces.keys():
            mujoco.mj_contactForce(peer.model, peer.data, k, wrench)
            forces[finger] += wrench[0]
            depth = FORCE / (PAD_STIFFNESS * PAD[0] * PAD[1])
            assert -contact.dist == pytest.approx(depth, rel=0.02)
    assert list(forces.values()) == pytest.approx([FORCE, FORCE], rel=1e-3)


def turning_friction() -> float:
    """Smallest friction with which two patches of even pressure carry the bar beside its middle.

    At the limit a patch turns about a point on the line to the weight, and every spot rubs across
    the line to that point.
    """
    n = 200
    y, z = np.meshgrid(*(((np.arange(n) + 0.5) / n - 0.5) * size for size in PAD))
    near, far = 1e-6, 1.0
    while far - near > 1e-9:
        middle = (near + far) / 2
        r = np.hypot(y + middle, z)
        force = float(((y + middle) / r).mean())
        moment = float(((z * z + y * (y + middle)) / r).mean())
        near, far = (middle, far) if moment > LEVER * force else (near, middle)
    return MASSES["bar"] * LOAD / (2 * FORCE * force)


def test_pads_bear_the_torque_of_their_patch(peer: Peer) -> None:
    turned = []
    for share in (0.92, 1.08):
        assert peer.run("bar", from_above(0.0, LEVER), friction=share * turning_friction()).held
        turned.append(np.arccos(min(1.0, peer.data.body("bar").xmat[8])))
    assert turned[1] < np.deg2rad(1.0) < np.deg2rad(3.0) < turned[0]


def test_contacts_have_drakes_friction(peer: Peer) -> None:
    peer.run("bar", from_above(0.0, LEVER), friction=0.1)
    own, other = 0.1, 0.24
    found = {}
    for contact in peer.data.contact:
        one, two = (peer.model.body(peer.model.geom_bodyid[g]).name for g in contact.geom)
        found[frozenset((one, two))] = contact.friction[0]
    assert found[frozenset(("panda_leftfinger", "bar"))] == own
    assert found[frozenset(("world", "box"))] == pytest.approx(combined(other, TABLE_FRICTION))
    assert combined(own, TABLE_FRICTION) == pytest.approx(0.1 / 0.6)


def test_outcomes_do_not_depend_on_the_trials_before(peer: Peer) -> None:
    ends = []
    for _ in range(2):
        peer.run("box", CENTER, friction=1.02 * LIMIT)
        ends.append(peer.data.qpos.copy())
        peer.run("bar", from_above(0.0, LEVER), friction=0.5)
    np.testing.assert_array_equal(*ends)


def test_empty_and_blocked_grasps(peer: Peer) -> None:
    assert peer.run("box", from_above(0.06)) is Outcome.NO_CONTACT
    assert peer.run("box", from_above(0.01, 0.2)) is Outcome.NO_CONTACT
    assert peer.run("box", from_above(-0.05)) is Outcome.COLLISION_TARGET
    assert peer.run("bar", from_above(-0.015, LEVER)) is Outcome.COLLISION_TABLE
    aside = from_above(-0.01)
    aside[0, 3] = BESIDE - 0.045
    assert peer.run("box", aside) is Outcome.COLLISION_CLUTTER
