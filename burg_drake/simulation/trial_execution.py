"""Phases of one trial: approach, close, lift, hold, and the outcome with its margins.

They run in any stepped world, with any carrier of the hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Set as AbstractSet
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Margins, Outcome, inverse
from burg_drake.simulation.contacts import (
    NO_FINGER_CONTACT,
    BodyContact,
    NamedBodies,
    finger_contact,
    is_touched_from_outside,
    touched_bodies,
)
from burg_drake.simulation.object_motions import (
    GripMotion,
    MotionTracker,
    MovingBody,
    PlacedBodies,
    carried_past,
)
from burg_drake.simulation.settings import TrialSettings
from burg_drake.simulation.trial_result import TrialResult
from burg_drake.station import Engine, Hand


@dataclass(frozen=True, eq=False)
class HandSegment:
    """A straight segment of the hand with the target, from rest to rest.

    Attributes:
        direction_W: (3,) unit vector in the world.
        length: [m].
        checks: number of contact checks up to its end.
    """

    direction_W: Array
    length: float
    checks: int

    @property
    def is_straight_up(self) -> bool:
        """Whether the segment goes straight up, so that its acceleration acts along the weight."""
        return bool(self.direction_W[2] > 1.0 - 1e-9)


class Carrier(Protocol):
    """Moves the hand to the grasp and away from it, and monitors its contacts.

    Attributes:
        approach_checks: contact checks on the approach; 0 if the hand starts at the grasp.
        approach_steps: time steps between these contact checks.
        segments: segments with the target, at least one: the retreat, if any, and the lift.
        lift_time: duration of the segments [s].
        tracking_error, tracking_distance: see `Margins`; NaN if not measured.
    """

    approach_checks: int
    approach_steps: int
    segments: tuple[HandSegment, ...]
    lift_time: float
    tracking_error: float
    tracking_distance: float

    @property
    def touched(self) -> str:
        """See `TrialResult`."""
        ...

    def approach(self) -> None:
        """Starts the approach."""
        ...

    def close(self) -> None:
        """Commands the fingers to close, with the hand standing at the grasp."""
        ...

    def lift(self, segment_index: int, check: int) -> None:
        """Commands the motion in a segment from one contact check to the next. Segments and checks
        are counted from 0, the checks in each segment anew."""
        ...

    def stop(self) -> None:
        """Commands the hand to stay at the end of the last segment."""
        ...

    def advance_to(self, time: float) -> None:
        """Advances the simulation; repeating it from a restored state gives the same result."""
        ...

    def watch(self, contacts: list[BodyContact]) -> str:
        """Evaluates contacts and state at a check.

        Returns:
            Name of the obstacle, for `TrialResult.blocker`; "" if there is none.
        """
        ...

    def travelled(self) -> float:
        """Distance of the hand from the start of the current segment [m]."""
        ...

    def carries_full_load(self, check: int) -> bool:
        """Whether the grip has carried its largest load during the last checks, up to the end of
        interval `check` of the last segment."""
        ...

    def is_free_ahead(self) -> bool:
        """Whether the rest of the last segment is free of collisions for hand and held target; a
        geometric check without time steps."""
        ...


MIN_LIFT_SHARE = 0.5
"""Share of the hand's path that a lifted target must follow."""
SMALLEST_SHIFT = 1e-8
"""Metres. Targets are not shifted by less."""


class OtherTouched(Exception):
    """Raised in a single-target world when target or robot touch another movable object."""


class SteppedWorld(PlacedBodies, NamedBodies, Protocol):
    """A world of any engine in which trials run.

    Attributes:
        settings: phases of a trial.
        engine: time step and contact settings.
        free: bodies that can move, by name.
        standing: bodies that can move only in another world, by name.
        fixed: bodies that never move, by name, including the table.
        robot: all bodies of the robot.
        fingers: bodies of the two fingers.
        hand_document: the hand's document.
        robot_meets_hull: whether, in a single-target world, parts of the robot meet the target's
            hull.
    """

    settings: TrialSettings

    @property
    def engine(self) -> Engine: ...
    @property
    def standing(self) -> Mapping[str, BodyIndex]: ...
    @property
    def fixed(self) -> Mapping[str, BodyIndex]: ...
    @property
    def robot(self) -> AbstractSet[BodyIndex]: ...
    @property
    def fingers(self) -> tuple[BodyIndex, BodyIndex]: ...
    @property
    def hand_document(self) -> Hand: ...
    @property
    def robot_meets_hull(self) -> bool: ...

    @property
    def time(self) -> float:
        """Time since the start of the trial [s]."""
        ...

    @property
    def gravity(self) -> Array:
        """(3,) gravity in the world [m/s^2]."""
        ...

    def finger_speed(self) -> float:
        """Speed of the faster finger [m/s]."""
        ...

    def moving_body(self, body: BodyIndex) -> MovingBody:
        """State of a free body."""
        ...

    def shift(self, body: BodyIndex, distance_W: Array) -> None:
        """Shifts a free body by a distance (3,) [m]."""
        ...

    def push(self, body: BodyIndex, force_W: Array, torque_W: Array) -> None:
        """Applies a force (3,) at the centre of mass of a body [N] and a torque (3,) [N m], and
        none to others, until the next call."""
        ...

    def advance(self, steps: int) -> None:
        """Advances the simulation by time steps, with the current commands."""
        ...

    def X_WG(self) -> Array:
        """Grasp frame (4, 4) in the world."""
        ...

    def robot_positions(self, model: str) -> Array | None:
        """Positions of one of `ROBOT_MODELS`, in the order of a station diagram; None if
        missing."""
        ...

    def is_usable(self) -> bool:
        """Whether trials can begin in this world."""
        ...

    def invalidate(self) -> None:
        """Makes the next trial prepare the world from scratch."""
        ...

    def read_contacts(self) -> list[BodyContact]:
        """Current contacts.

        Raises:
            OtherTouched: the trial has to run in the complete world.
        """
        ...

    def state(self) -> Any:
        """The state that `restore_state` restores."""
        ...

    def restore_state(self, time: float, state: Any) -> None:
        """Restores a state and its time [s]."""
        ...

    def with_neighbours(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies, and all bodies so close that they may lean on each other."""
        ...

    def release(self, released: set[BodyIndex], still: set[BodyIndex]) -> None:
        """Unlocks the `released` objects; those in `still` stay locked."""
        ...


class Execution:
    """Runs a trial in a world that is prepared for its start.

    When something moving touches a locked object, the object and its neighbours are released: the
    trial returns to the previous contact check, before the contact, and continues from there.

    Args:
        world: the world of the trial.
        target: the grasped body.
        moving: the free objects that are not locked.
        carrier: moves the hand to the grasp and away from it.

    Attributes:
        contact: contact of the fingers with the target at the last check.
    """

    def __init__(
        self, world: SteppedWorld, target: BodyIndex, moving: set[BodyIndex], carrier: Carrier
    ) -> None:
        self._world = world
        self._carrier = carrier
        self._settings = world.settings
        self._target = target
        self._others = {name: index for name, index in world.free.items() if index != target}
        self._locked = set(world.free.values()) - moving
        self._path_length = sum(segment.length for segment in carrier.segments)
        self._direction = carrier.segments[0].direction_W
        self._center_start = self._center()
        self._followed = 0.0
        self._others_motion = MotionTracker(self._world, self._others.values())
        self._pushed: dict[str, float] = {}
        self.contact = NO_FINGER_CONTACT
        self._in_hand = GripMotion(self._settings, self.X_GO())
        self._touched = False
        self._blocker = ""
        self._steps = 0
        self._steps_per_check = max(1, round(self._settings.poll / world.engine.time_step))
        self._in_free_air = 0.0
        self._path_is_blocked = False
        self._left_to_go = 0.0

    def run(self) -> TrialResult:
        """Runs all phases.

        Raises:
            RuntimeError: the simulation failed.
            OtherTouched: the trial has to run in the complete world.
        """
        for phase in (self.approach, self.close, self.lift, self.hold):
            outcome = phase()
            if outcome is not None:
                return self.result(outcome)
        return self.result(self.outcome_if_held())

    def approach(self) -> Outcome | None:
        """Moves the hand to the grasp; returns the outcome if a fixed body blocks it, else None."""
        carrier = self._carrier
        if not carrier.approach_checks:
            return None
        target = MotionTracker(self._world, [self._target])
        carrier.approach()
        for _ in range(carrier.approach_checks):
            self.advance(carrier.approach_steps)
            target.update(self._locked)
            if self._blocker:
                break
        name = next(name for name, index in self._world.free.items() if index == self._target)
        self._pushed = self._motions_of_others(self._others_motion.farthest)
        self._pushed[name] = target.farthest[self._target]
        return Outcome.BLOCKED if self._blocker else None

    def close(self) -> Outcome | None:
        """Closes until the fingers rest; None if both then hold the target, else the outcome."""
        settings = self._settings
        self._carrier.close()
        slow_since = math.inf
        timeout = max(settings.close_timeout, 2.0 * self._world.hand_document.closing_time)
        timeout += self._world.time
        while self._world.time < timeout:
            now = self.advance()
            if self._world.finger_speed() > settings.settled_speed:
                slow_since = math.inf
            else:
                slow_since = min(slow_since, now)
                if now - slow_since >= settings.settled_time - 1e-9:
                    break
        if self.contact.both:
            self._in_hand.grip()
            return None
        if self.contact.any:
            return Outcome.ONE_FINGER
        return Outcome.CLOSED_EMPTY if self._touched else Outcome.NO_CONTACT

    def lift(self) -> Outcome | None:
        """Moves the target along the retreat and the lift; None if `hold` has to decide, else the
        outcome."""
        carrier = self._carrier
        last = len(carrier.segments) - 1
        for segment_index, segment in enumerate(carrier.segments):
            self._start_segment(segment)
            for check in range(segment.checks):
                carrier.lift(segment_index, check)
                self.advance()
                if self._blocker:
                    return Outcome.BLOCKED
                if not self.contact.any:
                    return Outcome.SLIPPED
                if (
                    segment_index == last
                    and carrier.carries_full_load(check)
                    and self._is_decided(segment)
                ):
                    return self.outcome_if_held()
        carrier.stop()
        if self.contact.both and self.distance_followed() >= MIN_LIFT_SHARE * self._path_length:
            return None
        return Outcome.SLIPPED

    def hold(self) -> Outcome | None:
        """Waits; None if the target is held at the end, else the outcome.

        Unless the whole trial is requested, a steady grip ends it early.
        """
        settings = self._settings
        self._in_hand.reset()
        for _ in range(max(1, round(settings.hold_time / settings.poll))):
            self.advance()
            if self._blocker:
                return Outcome.BLOCKED
            if not self.contact.any:
                return Outcome.DROPPED
            if self._world.engine.whole_trial:
                continue
            if self._in_hand.is_steady and self._in_hand.is_verdict_stable(settings.hold_time):
                break
        return None if self.contact.both else Outcome.DROPPED

    def outcome_if_held(self) -> Outcome:
        """The outcome if the target is held to the end."""
        if self._in_hand.is_beyond_limits:
            return Outcome.LIFTED_TURNED
        disturbed = _largest(self._others_motion.farthest) > self._settings.disturbance
        return Outcome.LIFTED_DISTURBED if disturbed else Outcome.LIFTED

    def _start_segment(self, segment: HandSegment) -> None:
        """Measures the target's distance along a segment from now on."""
        if segment.direction_W is not self._direction:
            self._followed, self._center_start = self.distance_followed(), self._center()
            self._direction = segment.direction_W

    def _is_decided(self, last: HandSegment) -> bool:
        """Whether it is already certain that the target will be held to the end.

        While the hand accelerates upwards, the load on the grip is largest. If friction does not
        carry it, the target slides ever faster. So a target that sticks to the pads then, or creeps
        at constant speed where friction is viscous, is held to the end, if it is in free air and
        all other objects are at rest.
        """
        if self._world.engine.whole_trial or self._path_is_blocked:
            return False
        time = self._carrier.lift_time + self._settings.hold_time
        in_hand = self._in_hand
        creeps = self._world.engine.friction_creeps and in_hand.is_coming_to_rest(time)
        if not self.contact.both or not (in_hand.is_steady or creeps):
            return False
        if self._in_free_air < self._settings.steady_time - 1e-9:
            return False
        left = last.length - self._carrier.travelled()
        if self.distance_followed() + left < MIN_LIFT_SHARE * self._path_length:
            return False
        if not in_hand.is_verdict_stable(time):
            return False
        self._path_is_blocked = not self._carrier.is_free_ahead()
        if not self._path_is_blocked:
            self._left_to_go = left
        return not self._path_is_blocked

    def advance(self, steps: int | None = None) -> float:
        """Advances to the next contact check; returns the time [s].

        Args:
            steps: number of time steps; by default those in `poll`.

        Raises:
            RuntimeError: the simulation failed.
            OtherTouched: the trial has to run in the complete world.
        """
        before = self._time()
        steps = self._steps_per_check if steps is None else steps
        self._steps += steps
        time = self._time()
        while True:
            state = self._world.state() if self._locked else None
            self._carrier.advance_to(time)
            if not math.isfinite(self._center()[2]):
                raise RuntimeError(f"the state is not finite at {time:.3f} s")
            contacts = self._world.read_contacts()
            moving = self._world.robot | (set(self._world.free.values()) - self._locked)
            found = touched_bodies(contacts, moving, self._locked)
            if not found:
                break
            self._world.restore_state(before, state)
            found = self._world.with_neighbours(found) & self._locked
            self._locked -= found
            self._world.release(found, self._locked)
        self._record_contacts(contacts)
        if self.contact.both:
            self._keep_in_grip(steps)
        return time

    def _keep_in_grip(self, steps: int) -> None:
        """Shifts a target that turns in the grip to where the last steps should have left it."""
        world, target = self._world, self._target
        p_OG_W = world.X_WG()[:3, 3] - world.X_WB(target)[:3, 3]
        w_W, step = world.moving_body(target).w_W, world.engine.time_step
        shift = -carried_past(w_W, p_OG_W, step, steps)
        if float(np.abs(shift).max()) > SMALLEST_SHIFT:
            world.shift(target, shift)

    def _time(self) -> float:
        """Time of the last contact check [s]: whole time steps, rounded as Drake's own steps
        are."""
        return self._steps * self._world.engine.time_step

    def _record_contacts(self, contacts: list[BodyContact]) -> None:
        """Evaluates contacts and poses."""
        settings, target = self._settings, self._target
        self.contact = finger_contact(contacts, self._world.fingers, target)
        self._touched = self._touched or self.contact.any
        largest_motion = self._others_motion.update(self._locked)
        others_rest = largest_motion <= settings.settled_speed * settings.poll
        self._in_hand.record(self.X_GO(), others_rest=others_rest)
        self._blocker = self._carrier.watch(contacts)
        free = not is_touched_from_outside(contacts, self._world.robot | {target})
        self._in_free_air = self._in_free_air + settings.poll if free else 0.0

    def distance_followed(self) -> float:
        """Distance of the target's centre of mass along the hand's segments [m]: its rise in a lift
        straight up."""
        return self._followed + float((self._center() - self._center_start) @ self._direction)

    def X_GO(self) -> Array:
        """Pose (4, 4) of the target in the grasp frame."""
        X_GO: Array = inverse(self._world.X_WG()) @ self._world.X_WB(self._target)
        return X_GO

    def _center(self) -> Array:
        """The target's centre of mass (3,) in the world [m]."""
        return self._world.center(self._target)

    def _motions_of_others(self, values: Mapping[BodyIndex, float]) -> dict[str, float]:
        """Motions of the other objects by name; 0 for welded ones."""
        standing = dict.fromkeys(self._world.standing, 0.0)
        return standing | {name: values[index] for name, index in self._others.items()}

    def result(self, outcome: Outcome) -> TrialResult:
        """The result of an outcome, with the current margins."""
        force = area = math.nan
        slip, tilt = self._in_hand.since_grip
        if not math.isnan(slip):
            closing = self._world.X_WG()[:3, 0]
            force = float(np.abs(self.contact.force @ closing).min())
            area = float(self.contact.area.min())
        margins = Margins(
            overlap=0.0,
            slip=slip,
            tilt=tilt,
            pad_force=force,
            patch_area=area,
            lift=self.distance_followed() + self._left_to_go,
            others_moved=_largest(self._others_motion.farthest),
            others_turned=_largest(self._others_motion.turned),
            end_time=self._world.time,
            tracking_error=self._carrier.tracking_error,
            tracking_distance=self._carrier.tracking_distance,
            pushed=max(self._pushed.values(), default=math.nan),
        )
        return TrialResult(
            outcome=outcome,
            margins=margins,
            blocker=self._blocker if outcome is Outcome.BLOCKED else "",
            displacements=self._motions_of_others(self._others_motion.farthest),
            turned=self._motions_of_others(self._others_motion.turned),
            toppled=", ".join(self._others_motion.toppled(self._others)),
            pushed=self._pushed,
            touched=self._carrier.touched,
        )


def _largest(values: Mapping[BodyIndex, float]) -> float:
    return max(values.values(), default=0.0)
