"""One trial: the hand closes until the fingers rest, rises and holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, inverse, pose, rotation_angle
from .hand import (
    DEFAULT_PHASES,
    FINGER_PARTS,
    GRAVITY,
    PAD,
    PAD_CENTER_Z,
    PAD_STIFFNESS,
    PADS,
    PALM,
    Phases,
)
from .motion import State, World
from .solid import MassProperties, Solid

MINIMUM_LIFT = 0.5
"""Share of the hand's way that the object must go with it to count as lifted."""
FOULED = 2e-4
"""What comes so close to a part of the hand other than the pads would have touched it [m]."""
LOOK = 4
"""Polls from look to look at the other parts of the hand, which take time."""
SWALLOWED = 3e-3
"""Deeper than that nothing is pressed into a pad: it must have got at a side of it [m]."""


@dataclass(frozen=True)
class Numerics:
    """How finely a trial is computed, and what contact is like.

    Attributes:
        step: [s].
        bristle: stiffness of a bristle, over that of the pad.
        dissipation: Hunt and Crossley's [s/m]; see `foundation`.
        table_stiffness: pressure over depth [N/m^3]; stiff enough that what stands on it sinks by
            micrometres, and soft enough for the step.
    """

    step: float = 4e-5
    bristle: float = 1.0
    dissipation: float = 5.0
    table_stiffness: float = 3e9


DEFAULT_NUMERICS = Numerics()


@dataclass(frozen=True, eq=False)
class Grip:
    """What is tried.

    Attributes:
        solid: the object, in its frame O.
        feet: the same, more coarsely, for the table and for looking where else the hand touches.
        mass_properties: of unit mass.
        X_WO: (4, 4) where it stands; the table is the plane z = 0.
        X_OG: (4, 4) the grasp.
        friction: of pads and object.
        table_friction: of table and object.
        mass: [kg].
        coupled: one drive moves both fingers.
    """

    solid: Solid
    feet: Solid
    mass_properties: MassProperties
    X_WO: Array
    X_OG: Array
    friction: float
    table_friction: float
    mass: float
    coupled: bool = True


@dataclass(frozen=True)
class Verdict:
    """What became of it.

    Attributes:
        lifted: both pads touch at the end, and the object has come at least half the way.
        slip: displacement in the hand since the grip, at the origin of G [m].
        tilt: rotation in the hand since the grip [rad].
        lift: how far the centre of mass rose [m].
        pad_force: of the weaker pad [N].
        fouled: something other than a pad would have touched the object.
        end: [s].
    """

    lifted: bool
    slip: float
    tilt: float
    lift: float
    pad_force: float
    fouled: bool
    end: float


class Trial:
    """A trial that can be stepped.

    Args:
        grip: what is tried.
        numerics: how.
        phases: of the trial.

    Attributes:
        world, state: see `motion`.
    """

    def __init__(
        self, grip: Grip, numerics: Numerics = DEFAULT_NUMERICS, phases: Phases = DEFAULT_PHASES
    ) -> None:
        self._grip, self._phases, self._step = grip, phases, numerics.step
        solid, center = grip.solid, grip.mass_properties.center
        self._X_OB = pose(np.eye(3), center)
        X_GB = inverse(grip.X_OG) @ self._X_OB
        X_WG = grip.X_WO @ grip.X_OG
        samples, feet = _from_center(solid, center), _from_center(grip.feet, center)
        points_G = samples[:3].T @ X_GB[:3, :3].T + X_GB[:3, 3]
        distance = first_touch(points_G) + phases.gap
        self.state = State.at(
            X_GB[:3, 3], X_GB[:3, :3], np.full(2, distance), len(solid.areas), len(grip.feet.areas)
        )
        self.world = World(
            samples=samples,
            feet=feet,
            mass=(grip.mass, phases.finger_mass),
            inverse_inertia=np.linalg.inv(grip.mass * grip.mass_properties.inertia),
            front=np.array((PAD[0] / 2, PAD[1] / 2, PAD_CENTER_Z, solid.spacing)),
            pad_material=_material(PAD_STIFFNESS, numerics, grip.friction),
            table_material=_material(numerics.table_stiffness, numerics, grip.table_friction),
            up=X_WG[2, :3].copy(),
            table=-float(X_WG[2, 3]),
            gravity=GRAVITY,
            servo=np.array((-phases.closing_speed, phases.gain, phases.force, float(grip.coupled))),
            step=numerics.step,
        )
        self.time = 0.0
        self.fouled = False

    def advance(self, acceleration: float = 0.0) -> None:
        """Steps to the next look.

        Args:
            acceleration: of the hand upwards [m/s^2].
        """
        steps = round(self._phases.poll / self._step)
        self.world.advance(self.state, steps, acceleration)
        self.time += self._phases.poll
        if round(self.time / self._phases.poll) % LOOK == 0:
            self.fouled = self.fouled or self._is_fouled()

    def close(self) -> bool:
        """Closes until the fingers rest; whether both hold the object then."""
        phases, slow_since = self._phases, np.inf
        while self.time < phases.close_timeout:
            self.advance()
            if np.abs(self.state.fingers[:, 1]).max() > phases.settled_speed:
                slow_since = np.inf
            else:
                slow_since = min(slow_since, self.time)
                if self.time - slow_since >= phases.settled_time - 1e-9:
                    break
        return self.touching == 2

    @property
    def touching(self) -> int:
        """How many pads touch the object."""
        return int((self.state.forces[:2] > 0.0).sum())

    @property
    def risen(self) -> float:
        """Height of the centre of mass above where it is at rest in the hand's frame [m]."""
        return float(self.state.body[:3] @ self.world.up + self.state.hand[0])

    @property
    def X_GO(self) -> Array:
        """(4, 4) object in the hand."""
        body = self.state.body
        X_GB = pose(body[3:12].reshape(3, 3), body[:3])
        X_GO: Array = X_GB @ inverse(self._X_OB)
        return X_GO

    def run(self) -> Verdict:
        """The whole trial."""
        phases, start = self._phases, self.risen
        if not self.close():
            return self._verdict(False, start, None)
        gripped = self.X_GO
        half = max(1, round(phases.lift_time / phases.poll / 2))
        acceleration = phases.lift / (half * phases.poll) ** 2
        for count, sign in ((half, 1.0), (half, -1.0)):
            for _ in range(count):
                self.advance(sign * acceleration)
                if self.touching == 0:
                    return self._verdict(False, start, gripped)
        self.state.hand[1] = 0.0
        if self.touching < 2 or self.risen - start < MINIMUM_LIFT * phases.lift:
            return self._verdict(False, start, gripped)
        for _ in range(max(1, round(phases.hold_time / phases.poll))):
            self.advance()
            if self.touching == 0:
                break
        return self._verdict(self.touching == 2, start, gripped)

    def _verdict(self, lifted: bool, start: float, gripped: Array | None) -> Verdict:
        slip = tilt = np.nan
        if gripped is not None:
            X_GG = self.X_GO @ inverse(gripped)
            slip, tilt = float(np.linalg.norm(X_GG[:3, 3])), rotation_angle(X_GG[:3, :3])
        return Verdict(
            lifted=lifted,
            slip=slip,
            tilt=tilt,
            lift=self.risen - start,
            pad_force=float(self.state.forces[:2].min()),
            fouled=self.fouled,
            end=round(self.time, 3),
        )

    def _is_fouled(self) -> bool:
        """Whether a part of the hand other than the fronts of the pads is touched."""
        X_GO = self.X_GO
        points = self._grip.feet.points @ X_GO[:3, :3].T + X_GO[:3, 3]
        return bool(touches_hand(points, self.state.fingers[:, 0], FOULED))


def touches_hand(points_G: Array, distances: Array, margin: float) -> bool:
    """Whether points (N, 3) touch the hand elsewhere than at the fronts of the pads."""
    lowest = PAD_CENTER_Z + PAD[1] / 2 + margin
    near = points_G[(points_G[:, 2] < lowest) & (np.abs(points_G[:, 1]) < 0.04)]
    for box in (*PALM, *FINGER_PARTS):
        if box.contains(near, distances[0] if box.side >= 0 else distances[1], margin).any():
            return True
    for box, distance in zip(PADS, distances, strict=True):
        inside = near[box.contains(near, distance, 0.0)]
        if (box.side * inside[:, 0] - distance > SWALLOWED).any():
            return True
    return False


def first_touch(points_G: Array) -> float:
    """Distance of the pads from the middle where the first of them touches [m]."""
    over = (np.abs(points_G[:, 1]) < PAD[0] / 2) & (
        np.abs(points_G[:, 2] - PAD_CENTER_Z) < PAD[1] / 2
    )
    between = over & (np.abs(points_G[:, 0]) < 0.04)
    return float(np.abs(points_G[between, 0]).max(initial=0.0))


def _material(stiffness: float, numerics: Numerics, friction: float) -> Array:
    return np.array((stiffness, numerics.bristle * stiffness, friction, numerics.dissipation))


def _from_center(solid: Solid, center: Array) -> Array:
    """(7, n) points from a centre, normals, areas."""
    return np.vstack(((solid.points - center).T, solid.normals.T, solid.areas))
