"""Arrays on the device for trials in many worlds at once, and how trials end there.

Annotations are not postponed, as Warp reads them.
"""

from typing import Any

import warp as wp
from mujoco_warp import Data, Model

IDLE_PHASE = 4
"""Phase of a world without a trial; see `trial_kernels`."""
NO_BODY = 1 << 30
"""Larger than all numbers of bodies and checks."""
PairFriction = wp.types.vector(length=5, dtype=float)


@wp.struct
class Constants:
    """What all trials of a batch share: settings, numbers in the model, and the start.

    Attributes:
        step, poll, hold_time: [s].
        steps_per_check, close_timeout, settled_checks, hold_checks, steady_checks: see
            `TrialSettings`, in steps and checks.
        settled_speed, creep_per_check, rest_per_check, slip_limit, tilt_limit: likewise
            [m/s, m, m, m, rad].
        carried_mass: of carrier and hand, with the inertia of the drive [kg].
        early: 1 if trials may end early.
        approaches: 1 if trials begin at the pregrasp.
        shakes: 1 if the hand is shaken in place of the lift.
        shake_acceleration, turn_acceleration, shake_frequency, shake_periods: see `ShakeSettings`.
        overflows: bits of overflows that matter.
        target, hand, finger_1, finger_2, carrier, table: bodies.
        lift_joint, lift_qpos, lift_dof, lift_position_servo, lift_speed_servo: of the carrier.
        finger_qpos, finger_dof, finger_servo: of both fingers.
        closing_speed: of both fingers, signed [m/s].
        target_qpos, target_dof: first position and degree of freedom of the target.
        target_mass: mass in the library [kg].
        gravity: (3,) that acts on free bodies [m/s^2].
        p_HG, q_HG: the grasp frame in the hand.
        p_OCm, q_OI: centre of mass and principal axes of the target in its frame.
        p_WO, q_WO, center: the target at the start, and its centre of mass.
    """

    step: float
    poll: float
    hold_time: float
    steps_per_check: int
    close_timeout: int
    settled_checks: int
    hold_checks: int
    steady_checks: int
    settled_speed: float
    creep_per_check: float
    rest_per_check: float
    slip_limit: float
    tilt_limit: float
    carried_mass: float
    early: int
    approaches: int
    shakes: int
    shake_acceleration: float
    turn_acceleration: float
    shake_frequency: float
    shake_periods: float
    overflows: int
    target: int
    hand: int
    finger_1: int
    finger_2: int
    carrier: int
    table: int
    lift_joint: int
    lift_qpos: int
    lift_dof: int
    lift_position_servo: int
    lift_speed_servo: int
    finger_qpos: wp.vec2i
    finger_dof: wp.vec2i
    finger_servo: wp.vec2i
    closing_speed: wp.vec2
    target_qpos: int
    target_dof: int
    target_mass: float
    gravity: wp.vec3
    p_HG: wp.vec3
    q_HG: wp.quat
    p_OCm: wp.vec3
    q_OI: wp.quat
    p_WO: wp.vec3
    q_WO: wp.quat
    center: wp.vec3


@wp.struct
class Bodies:
    """What bodies, geoms, contact pairs and corners are.

    Attributes:
        of_geom: (geoms,) body.
        standing, fixed: (bodies,) 1 if it moves only in the complete world, or never.
        sphere: (geoms,) number of a sphere of a pad; below 0 for other geoms.
        finger: (geoms,) finger (0 or 1) of such a sphere.
        friction: (geoms,) own coefficient; below 0 where the target's counts as it is.
        pair_friction: (pairs,) coefficient of the table; below 0 where it does not meet the target.
        qpos: (nq,) positions at the start, but for the fingers.
        corners: (K,) corners of the target's hull in its frame.
        others: (M,) other bodies that can move.
        others_p, others_q, others_center: (M,) their poses and centres of mass at the start.
        others_height: (M,) heights of these above their lowest points [m].
        others_corners: corners of their hulls in their frames, one after the other.
        others_first: (M + 1,) number of the first corner of each, and of all corners.
    """

    of_geom: wp.array(dtype=int)
    standing: wp.array(dtype=int)
    fixed: wp.array(dtype=int)
    sphere: wp.array(dtype=int)
    finger: wp.array(dtype=int)
    friction: wp.array(dtype=wp.float64)
    pair_friction: wp.array(dtype=wp.float64)
    qpos: wp.array(dtype=float)
    corners: wp.array(dtype=wp.vec3)
    others: wp.array(dtype=int)
    others_p: wp.array(dtype=wp.vec3)
    others_q: wp.array(dtype=wp.quat)
    others_center: wp.array(dtype=wp.vec3)
    others_height: wp.array(dtype=float)
    others_corners: wp.array(dtype=wp.vec3)
    others_first: wp.array(dtype=int)


@wp.struct
class Trials:
    """Trials to execute, and how they end; one row each.

    Attributes:
        p_WH, q_WH: start of the hand.
        p_GO, q_GO: the target in the grasp frame at the start.
        fingers: positions of both fingers at the start.
        friction, mass: of the target.
        pads: stiffness, damping and impedance of the contact of each pad.
        early: 1 if the trial may end before the end of its lift.
        turn_sign: 1 if a shaken hand first turns about its closing axis, -1 for the other sense.
        ways: the approach, and one or two segments: direction in the world, and length.
        checks: number of checks of each; 0 if there is none.
        time: duration of the segments with the target [s].
        end: see `End`.
        check: number of the last check.
        slip, tilt: motion in the hand since the grip; below 0 without a grip.
        force: of each pad along the closing axis [N].
        spheres: number of spheres of each pad in contact.
        lift, left: distance along the segments, and rest of the last one [m].
        pushed: farthest motion of a corner of the target on the approach [m].
        blocker: body that blocks the hand.
        p_WO, q_WO, last_fingers, travelled: state at the end.
        p_WG: where the last segment began.
        others_moved, others_turned: largest motion of each other body [m, rad].
        others_toppled: 1 if it has toppled, see `MotionTracker`.
        others_p, others_q: their poses at the end.
    """

    p_WH: wp.array(dtype=wp.vec3)
    q_WH: wp.array(dtype=wp.quat)
    p_GO: wp.array(dtype=wp.vec3)
    q_GO: wp.array(dtype=wp.quat)
    fingers: wp.array(dtype=wp.vec2)
    friction: wp.array(dtype=wp.float64)
    mass: wp.array(dtype=float)
    pads: wp.array2d(dtype=wp.vec3)
    early: wp.array(dtype=int)
    turn_sign: wp.array(dtype=int)
    ways: wp.array2d(dtype=wp.vec4)
    checks: wp.array2d(dtype=int)
    time: wp.array(dtype=float)
    end: wp.array(dtype=int)
    check: wp.array(dtype=int)
    slip: wp.array(dtype=float)
    tilt: wp.array(dtype=float)
    force: wp.array(dtype=wp.vec2)
    spheres: wp.array(dtype=wp.vec2i)
    lift: wp.array(dtype=float)
    left: wp.array(dtype=float)
    pushed: wp.array(dtype=float)
    blocker: wp.array(dtype=int)
    p_WO: wp.array(dtype=wp.vec3)
    q_WO: wp.array(dtype=wp.quat)
    last_fingers: wp.array(dtype=wp.vec2)
    travelled: wp.array(dtype=float)
    p_WG: wp.array(dtype=wp.vec3)
    others_moved: wp.array2d(dtype=float)
    others_turned: wp.array2d(dtype=float)
    others_toppled: wp.array2d(dtype=int)
    others_p: wp.array2d(dtype=wp.vec3)
    others_q: wp.array2d(dtype=wp.quat)


@wp.struct
class WorldStates:
    """The trial of each world.

    Attributes:
        trial, phase: the trial and its phase.
        check: number of checks since the start.
        in_phase: since the start of the phase or segment.
        segment: 0 for the approach, 1 and 2 for the segments with the target.
        step: steps of the segment.
        slow_since: check of the phase since which the fingers are slow; `NO_BODY` if they are not.
        touched: 1 once a finger has touched the target.
        free_checks: checks in which nothing else has touched the hand or the target.
        p_last, q_last, p_grip, q_grip: the target in the grasp frame at the last check, and at the
            start of the grip.
        motions, motion_count: of the target in the hand at the last checks.
        center_start, followed: centre of mass at the start of the segment, and distance along
            earlier ones.
        p_WG: where the segment began.
        pushed: see `Trials`.
        touch, force, spheres: of each finger in this check; forces in `FORCE_UNIT`.
        outside: 1 if something else touches hand or target.
        other: 1 if it can move only in the complete world.
        hand_touches: 1 if something touches the hand.
        blocker: the fixed body, but for the table, with the lowest number that touches the hand.
        on_table: 1 if the table does.
        seen: last check in which each sphere was counted.
        others_moved, others_turned: see `Trials`.
        others_over: 1 if it has gone over an edge, or rested at another height.
        others_tilted: 1 if its vertical axis is no longer vertical.
        others_last: centre of mass at the last check.
        others_step: largest motion of such a centre since the check before.
    """

    trial: wp.array(dtype=int)
    phase: wp.array(dtype=int)
    check: wp.array(dtype=int)
    in_phase: wp.array(dtype=int)
    segment: wp.array(dtype=int)
    step: wp.array(dtype=int)
    slow_since: wp.array(dtype=int)
    touched: wp.array(dtype=int)
    free_checks: wp.array(dtype=int)
    p_last: wp.array(dtype=wp.vec3)
    q_last: wp.array(dtype=wp.quat)
    p_grip: wp.array(dtype=wp.vec3)
    q_grip: wp.array(dtype=wp.quat)
    motions: wp.array2d(dtype=float)
    motion_count: wp.array(dtype=int)
    center_start: wp.array(dtype=wp.vec3)
    followed: wp.array(dtype=float)
    p_WG: wp.array(dtype=wp.vec3)
    pushed: wp.array(dtype=float)
    touch: wp.array2d(dtype=int)
    force: wp.array2d(dtype=wp.int64)
    spheres: wp.array2d(dtype=int)
    outside: wp.array(dtype=int)
    other: wp.array(dtype=int)
    hand_touches: wp.array(dtype=int)
    blocker: wp.array(dtype=int)
    on_table: wp.array(dtype=int)
    seen: wp.array2d(dtype=int)
    others_moved: wp.array2d(dtype=float)
    others_turned: wp.array2d(dtype=float)
    others_over: wp.array2d(dtype=int)
    others_tilted: wp.array2d(dtype=int)
    others_last: wp.array2d(dtype=wp.vec3)
    others_step: wp.array(dtype=float)


@wp.struct
class Counts:
    """Numbers over all worlds, each in an array of one element.

    Attributes:
        begun, done: trials that have begun, and that have ended.
        rows: largest number of constraint rows of a world.
        contacts: largest number of contacts, or of pairs that are near, in all worlds together.
    """

    begun: wp.array(dtype=int)
    done: wp.array(dtype=int)
    rows: wp.array(dtype=int)
    contacts: wp.array(dtype=int)


@wp.struct
class Physics:
    """Arrays of MuJoCo Warp's `Data` and `Model`, by their names there."""

    qpos: wp.array2d(dtype=float)
    qvel: wp.array2d(dtype=float)
    ctrl: wp.array2d(dtype=float)
    qacc_warmstart: wp.array2d(dtype=float)
    qfrc_applied: wp.array2d(dtype=float)
    xfrc_applied: wp.array2d(dtype=wp.spatial_vector)
    time: wp.array(dtype=float)
    xpos: wp.array2d(dtype=wp.vec3)
    xquat: wp.array2d(dtype=wp.quat)
    xipos: wp.array2d(dtype=wp.vec3)
    nefc: wp.array(dtype=int)
    nacon: wp.array(dtype=int)
    ncollision: wp.array(dtype=int)
    overflow: wp.array(dtype=int)
    body_pos: wp.array2d(dtype=wp.vec3)
    body_quat: wp.array2d(dtype=wp.quat)
    jnt_axis: wp.array2d(dtype=wp.vec3)
    geom_friction: wp.array2d(dtype=wp.vec3)
    geom_solref: wp.array2d(dtype=wp.vec2)
    geom_solimp: wp.array2d(dtype=PairFriction)
    pair_friction: wp.array2d(dtype=PairFriction)
    body_mass: wp.array2d(dtype=float)
    body_inertia: wp.array2d(dtype=wp.vec3)
    body_subtreemass: wp.array2d(dtype=float)
    body_invweight0: wp.array2d(dtype=wp.vec2)
    dof_invweight0: wp.array2d(dtype=float)


PER_WORLD = (
    "body_pos",
    "body_quat",
    "jnt_axis",
    "geom_friction",
    "geom_solref",
    "geom_solimp",
    "pair_friction",
    "body_mass",
    "body_inertia",
    "body_subtreemass",
    "body_invweight0",
    "dof_invweight0",
)
"""Arrays of the model in `Physics`, which differ between worlds."""


def element_types(structure: Any) -> dict[str, Any]:
    """Types of the elements of the arrays in a structure, by their names."""
    return {name: variable.type.dtype for name, variable in structure.vars.items()}


def physics_of(model: Model, data: Data) -> Physics:
    """The arrays of a model and its data."""
    physics = Physics()
    for name in element_types(Physics):
        setattr(physics, name, getattr(model if name in PER_WORLD else data, name))
    return physics


@wp.struct
class Check:
    """What a check finds in a world, see `WorldStates` and `Trials`."""

    trial: int
    number: int
    both: bool
    some: bool
    blocker: int
    p_GO: wp.vec3
    q_GO: wp.quat
    slip: float
    tilt: float
    largest_motion: float
    mean_motion: float
    is_steady: bool
    direction: wp.vec3
    length: float
    travelled: float
    followed: float
    last: int
    path: float
    left: float


@wp.struct
class Masses:
    """The target with the library's mass.

    Attributes:
        inertia: principal moments [kg m^2].
        mobility: its `body_invweight0`.
        dof_mobility: `dof_invweight0` of its degrees of freedom.
    """

    inertia: wp.vec3
    mobility: wp.vec2
    dof_mobility: wp.spatial_vector
