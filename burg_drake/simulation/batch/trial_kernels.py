"""Phases of trials on the device: what `Execution` and `MujocoCarrier` do, in many worlds at once.

A check is `TrialSettings.poll` long, as in the other engines. In each step `command_lift` moves the
carriers. After each check `read_contacts` sums the contacts of each world, `judge` advances its
phase or ends the trial. Sums of forces are integers, so that they do not depend on the order of
their terms.

Annotations are not postponed, as Warp reads them.
"""

import warp as wp

from burg_drake.simulation.batch.device_arrays import (
    IDLE_PHASE,
    NO_BODY,
    Bodies,
    Check,
    Constants,
    Counts,
    Physics,
    Trials,
    WorldStates,
)
from burg_drake.simulation.batch.trial_starts import End
from burg_drake.simulation.object_motions import SLIP_LEVER
from burg_drake.simulation.trial_execution import MIN_LIFT_SHARE, SMALLEST_SHIFT

APPROACH, CLOSE, LIFT, HOLD = 0, 1, 2, 3
"""Phases of a world; `IDLE_PHASE` is the last."""
FORCE_UNIT = 1e-6
"""Newton. Unit of summed forces."""
COS_TILTED, MIN_HEIGHT_CHANGE, MIN_HEIGHT_SHARE = 0.70710678, 0.003, 0.1
"""See `MotionTracker`; the second one in metres."""


@wp.func
def to_xyzw(q: wp.quat):
    """A quaternion of MuJoCo, wxyz, as one of Warp."""
    return wp.quat(q[1], q[2], q[3], q[0])


@wp.func
def target_orientation(c: Constants, physics: Physics, w: int):
    """The target's orientation by its position, as that of its body is the one before the step."""
    p = c.target_qpos
    return wp.normalize(
        wp.quat(
            physics.qpos[w, p + 4],
            physics.qpos[w, p + 5],
            physics.qpos[w, p + 6],
            physics.qpos[w, p + 3],
        )
    )


@wp.func
def rotation_angle(q: wp.quat):
    """Rotation angle of a unit quaternion [rad]."""
    return 2.0 * wp.atan2(wp.length(wp.vec3(q[0], q[1], q[2])), wp.abs(q[3]))


@wp.func
def along(length: float, steps: int, step: int, time_step: float):
    """Position and speed after some steps of a segment from rest to rest."""
    share = wp.min(1.0, float(step) / float(steps))
    left = wp.min(share, 1.0 - share)
    gone = 2.0 * left * left
    if share >= 0.5:
        gone = 1.0 - gone
    return wp.vec2(length * gone, 4.0 * length * left / (float(steps) * time_step))


@wp.func
def stroke(periods: float, acceleration: float, frequency: float):
    """Speed and acceleration of a stroke of `Shaking`."""
    if wp.int32(wp.floor(periods)) % 2 == 1:
        acceleration = -acceleration
    phase = 2.0 * wp.pi * (periods - wp.floor(periods))
    return acceleration * wp.vec2(wp.sin(phase) / (2.0 * wp.pi * frequency), wp.cos(phase))


@wp.func
def shake_target(c: Constants, trials: Trials, state: WorldStates, physics: Physics, w: int):
    """Applies the forces of a shaken hand to the target for the next step, as `Shaking` does."""
    # `command_lift` has counted the next step.
    begin = (float(state.step[w]) - 1.0) * c.step * c.shake_frequency
    middle = begin + 0.5 * c.step * c.shake_frequency
    speed, alpha_size, along = float(0.0), float(0.0), float(0.0)
    if middle < c.shake_periods:
        along = stroke(middle, c.shake_acceleration, c.shake_frequency)[1]
    elif middle < 2.0 * c.shake_periods:
        alpha_size = stroke(middle - c.shake_periods, c.turn_acceleration, c.shake_frequency)[1]
    if begin >= c.shake_periods and begin < 2.0 * c.shake_periods:
        speed = stroke(begin - c.shake_periods, c.turn_acceleration, c.shake_frequency)[0]
    q_WG = to_xyzw(physics.xquat[w, c.hand]) * c.q_HG
    side = float(trials.turn_sign[state.trial[w]])
    axis = wp.quat_rotate(q_WG, wp.vec3(side, 0.0, 0.0))
    omega, alpha = speed * axis, alpha_size * axis
    p, v = c.target_qpos, c.target_dof
    q_WO = target_orientation(c, physics, w)
    p_WO = wp.vec3(physics.qpos[w, p], physics.qpos[w, p + 1], physics.qpos[w, p + 2])
    v_WO = wp.vec3(physics.qvel[w, v], physics.qvel[w, v + 1], physics.qvel[w, v + 2])
    w_O = wp.vec3(physics.qvel[w, v + 3], physics.qvel[w, v + 4], physics.qvel[w, v + 5])
    w_W, p_OCm_W = wp.quat_rotate(q_WO, w_O), wp.quat_rotate(q_WO, c.p_OCm)
    v_W = v_WO + wp.cross(w_W, p_OCm_W)
    r = p_WO + p_OCm_W - state.p_WG[w]
    principal = physics.body_inertia[w, c.target]
    axes = wp.quat_to_matrix(q_WO * c.q_OI)
    inertia = axes * wp.diag(principal) * wp.transpose(axes)
    acceleration = along * wp.quat_rotate(q_WG, wp.vec3(0.0, 0.0, 1.0)) + wp.cross(alpha, r)
    acceleration += wp.cross(omega, wp.cross(omega, r)) + 2.0 * wp.cross(omega, v_W)
    torque = inertia * alpha + wp.cross(omega, inertia * omega)
    torque += wp.cross(w_W, inertia * omega) - inertia * wp.cross(w_W, omega)
    torque += wp.cross(omega, inertia * w_W)
    force = -trials.mass[state.trial[w]] * acceleration
    physics.xfrc_applied[w, c.target] = wp.spatial_vector(
        force[0], force[1], force[2], -torque[0], -torque[1], -torque[2]
    )


@wp.kernel(enable_backward=False)
def command_lift(c: Constants, trials: Trials, state: WorldStates, physics: Physics):
    """Commands the carriers for the next step."""
    w = wp.tid()
    phase = state.phase[w]
    position, speed, force = float(0.0), float(0.0), float(0.0)
    if phase != IDLE_PHASE:
        trial, segment = state.trial[w], state.segment[w]
        length = trials.ways[trial, segment][3]
        if phase == APPROACH or phase == LIFT:
            step, steps = state.step[w], trials.checks[trial, segment] * c.steps_per_check
            before = along(length, steps, step, c.step)
            after = along(length, steps, step + 1, c.step)
            state.step[w] = step + 1
            position, speed = after[0], after[1]
            force = c.carried_mass * (after[1] - before[1]) / c.step
        elif phase == HOLD or segment == 0:
            position = length
        if phase == LIFT and c.shakes == 1:
            shake_target(c, trials, state, physics, w)
    physics.ctrl[w, c.lift_position_servo] = position
    physics.ctrl[w, c.lift_speed_servo] = speed
    physics.qfrc_applied[w, c.lift_dof] = force


@wp.func
def finger_of(c: Constants, a: int, b: int):
    """The finger that touches the target in a contact of two bodies: 0 or 1; below 0 if none."""
    if (a == c.target and b == c.finger_1) or (b == c.target and a == c.finger_1):
        return 0
    if (a == c.target and b == c.finger_2) or (b == c.target and a == c.finger_2):
        return 1
    return -1


@wp.func
def is_hand(c: Constants, body: int):
    """Whether a body belongs to the hand."""
    return body == c.hand or body == c.finger_1 or body == c.finger_2


@wp.kernel(enable_backward=False)
def read_contacts(
    c: Constants,
    bodies: Bodies,
    state: WorldStates,
    physics: Physics,
    room: int,
    dist: wp.array(dtype=float),
    frame: wp.array(dtype=wp.mat33),
    geom: wp.array(dtype=wp.vec2i),
    worldid: wp.array(dtype=int),
    efc_address: wp.array2d(dtype=int),
    efc_force: wp.array2d(dtype=float),
):
    """Sums the contacts of each world."""
    i = wp.tid()
    if i >= wp.min(physics.nacon[0], room):
        return
    w = worldid[i]
    if dist[i] >= 0.0 or state.phase[w] == IDLE_PHASE:
        return
    a, b = bodies.of_geom[geom[i][0]], bodies.of_geom[geom[i][1]]
    hand_a, hand_b = is_hand(c, a), is_hand(c, b)
    if hand_a or hand_b:
        state.hand_touches[w] = 1
    if (hand_a or a == c.target) != (hand_b or b == c.target):
        state.outside[w] = 1
    if bodies.standing[a] == 1 or bodies.standing[b] == 1:
        state.other[w] = 1
    if (hand_a and b == c.table) or (hand_b and a == c.table):
        state.on_table[w] = 1
    elif hand_a and bodies.fixed[b] == 1:
        wp.atomic_min(state.blocker, w, b)
    elif hand_b and bodies.fixed[a] == 1:
        wp.atomic_min(state.blocker, w, a)
    finger = finger_of(c, a, b)
    if finger < 0:
        return
    state.touch[w, finger] = 1
    row = efc_address[i, 0]
    if row >= 0:
        on_second = wp.vec3(efc_force[w, row], efc_force[w, row + 1], efc_force[w, row + 2])
        q_WG = to_xyzw(physics.xquat[w, c.hand]) * c.q_HG
        closing = wp.quat_rotate(q_WG, wp.vec3(1.0, 0.0, 0.0))
        force = wp.float64(wp.dot(wp.transpose(frame[i]) * on_second, closing))
        if b != c.target:
            force = -force
        wp.atomic_add(state.force, w, finger, wp.int64(wp.round(force / wp.float64(FORCE_UNIT))))
    sphere = wp.max(bodies.sphere[geom[i][0]], bodies.sphere[geom[i][1]])
    if sphere >= 0:
        check = state.check[w] + 1
        if wp.atomic_max(state.seen, w, sphere, check) < check:
            wp.atomic_add(state.spheres, w, finger, 1)


@wp.kernel(enable_backward=False)
def track_others(c: Constants, bodies: Bodies, state: WorldStates, physics: Physics):
    """Tracks the other bodies that can move, as `MotionTracker` does."""
    w, k = wp.tid()
    if state.phase[w] == IDLE_PHASE:
        return
    body = bodies.others[k]
    p, q = physics.xpos[w, body], to_xyzw(physics.xquat[w, body])
    p_start, q_start = bodies.others_p[k], bodies.others_q[k]
    farthest, lowest = float(0.0), float(1.0e9)
    for i in range(bodies.others_first[k], bodies.others_first[k + 1]):
        at = p + wp.quat_rotate(q, bodies.others_corners[i])
        was = p_start + wp.quat_rotate(q_start, bodies.others_corners[i])
        farthest = wp.max(farthest, wp.length(at - was))
        lowest = wp.min(lowest, at[2])
    state.others_moved[w, k] = wp.max(state.others_moved[w, k], farthest)
    turn = rotation_angle(wp.normalize(q * wp.quat_inverse(q_start)))
    state.others_turned[w, k] = wp.max(state.others_turned[w, k], turn)
    up = wp.vec3(0.0, 0.0, 1.0)
    cosine = wp.dot(wp.quat_rotate_inv(q, up), wp.quat_rotate_inv(q_start, up))
    state.others_tilted[w, k] = 0
    center, height = physics.xipos[w, body], bodies.others_height[k]
    if cosine < COS_TILTED:
        state.others_tilted[w, k] = 1
        change = wp.abs(center[2] - lowest - height)
        if change > wp.max(MIN_HEIGHT_CHANGE, MIN_HEIGHT_SHARE * height):
            state.others_over[w, k] = 1
    wp.atomic_max(state.others_step, w, wp.length(center - state.others_last[w, k]))
    state.others_last[w, k] = center


@wp.func
def find(c: Constants, trials: Trials, state: WorldStates, physics: Physics, w: int):
    """Records a check of a world, and returns what it finds."""
    found = Check()
    found.trial = state.trial[w]
    found.number = state.check[w] + 1
    state.check[w] = found.number
    touch_1, touch_2 = state.touch[w, 0] == 1, state.touch[w, 1] == 1
    found.both = touch_1 and touch_2
    found.some = touch_1 or touch_2
    if state.outside[w] == 1:
        state.free_checks[w] = 0
    else:
        state.free_checks[w] = state.free_checks[w] + 1
    segment = wp.max(state.segment[w], 1)
    way = trials.ways[found.trial, segment]
    found.direction = wp.vec3(way[0], way[1], way[2])
    found.length = way[3]
    found.travelled = physics.qpos[w, c.lift_qpos]
    gone = physics.xipos[w, c.target] - state.center_start[w]
    found.followed = state.followed[w] + wp.dot(gone, found.direction)
    found.last = 1
    found.path = trials.ways[found.trial, 1][3]
    if trials.checks[found.trial, 2] > 0:
        found.last = 2
        found.path = found.path + trials.ways[found.trial, 2][3]
    found.blocker = state.blocker[w]
    lowers = found.direction[2] < -1.0e-6 and state.phase[w] >= LIFT
    if state.on_table[w] == 1 and lowers:
        found.blocker = wp.min(found.blocker, c.table)
    return found


@wp.func
def find_motion(c: Constants, state: WorldStates, physics: Physics, w: int, found: Check):
    """Records the motion of the target in the hand, and returns a check with it."""
    q_WH = to_xyzw(physics.xquat[w, c.hand])
    q_WG = q_WH * c.q_HG
    p_WG = physics.xpos[w, c.hand] + wp.quat_rotate(q_WH, c.p_HG)
    q_GO = wp.normalize(wp.quat_inverse(q_WG) * to_xyzw(physics.xquat[w, c.target]))
    p_GO = wp.quat_rotate_inv(q_WG, physics.xpos[w, c.target] - p_WG)
    turn = q_GO * wp.quat_inverse(state.q_last[w])
    moved = wp.length(p_GO - wp.quat_rotate(turn, state.p_last[w]))
    count = state.motion_count[w] + 1
    state.motions[w, (count - 1) % c.steady_checks] = wp.max(
        moved, rotation_angle(turn) * SLIP_LEVER
    )
    if state.others_step[w] > c.rest_per_check:
        count = 0
    state.motion_count[w] = count
    state.p_last[w] = p_GO
    state.q_last[w] = q_GO
    largest, total = float(0.0), float(0.0)
    for k in range(c.steady_checks):
        largest = wp.max(largest, state.motions[w, k])
        total += state.motions[w, k]
    found.is_steady = count >= c.steady_checks and largest <= c.creep_per_check
    found.mean_motion = total / float(c.steady_checks)
    found.p_GO = p_GO
    found.q_GO = q_GO
    found.slip = -1.0
    found.tilt = -1.0
    if state.phase[w] >= LIFT:
        turn = q_GO * wp.quat_inverse(state.q_grip[w])
        found.slip = wp.length(p_GO - wp.quat_rotate(turn, state.p_grip[w]))
        found.tilt = rotation_angle(turn)
    return found


@wp.func
def keep_in_grip(c: Constants, state: WorldStates, physics: Physics, w: int):
    """Shifts a target that turns in the grip to where the last steps should have left it; see
    `carried_past`."""
    p, v = c.target_qpos, c.target_dof
    q_WO = target_orientation(c, physics, w)
    w_O = wp.vec3(physics.qvel[w, v + 3], physics.qvel[w, v + 4], physics.qvel[w, v + 5])
    w_W = wp.quat_rotate(q_WO, w_O)
    q_WH = to_xyzw(physics.xquat[w, c.hand])
    p_WG = physics.xpos[w, c.hand] + wp.quat_rotate(q_WH, c.p_HG)
    turned = wp.cross(w_W, wp.cross(w_W, p_WG - physics.xpos[w, c.target]))
    shift = -0.5 * c.step * c.step * float(c.steps_per_check) * turned
    if wp.max(wp.abs(shift[0]), wp.max(wp.abs(shift[1]), wp.abs(shift[2]))) > SMALLEST_SHIFT:
        for i in range(3):
            physics.qpos[w, p + i] = physics.qpos[w, p + i] + shift[i]


@wp.func
def is_stable(c: Constants, found: Check, time: float):
    """Whether further creep cannot change if tilt and slip are within the limits; see
    `GripMotion`."""
    creep = found.mean_motion * (time / c.poll)
    slid, turned = creep * (1.0 + found.slip / SLIP_LEVER), creep / SLIP_LEVER
    if found.slip - slid > c.slip_limit or found.tilt - turned > c.tilt_limit:
        return True
    return found.slip + slid <= c.slip_limit and wp.min(wp.pi, found.tilt + turned) <= c.tilt_limit


@wp.func
def begin_segment(
    c: Constants,
    trials: Trials,
    state: WorldStates,
    physics: Physics,
    w: int,
    segment: int,
    turn: bool,
):
    """Begins a segment with the target where the hand is, at rest, along its own direction."""
    state.segment[w] = segment
    state.in_phase[w] = 0
    state.step[w] = 0
    if turn:
        joint, way = c.lift_joint, trials.ways[state.trial[w], segment]
        travelled = physics.qpos[w, c.lift_qpos]
        p_WH = physics.body_pos[w, c.carrier] + physics.jnt_axis[w, joint] * travelled
        physics.body_pos[w, c.carrier] = p_WH
        physics.jnt_axis[w, joint] = wp.vec3(way[0], way[1], way[2])
        physics.qpos[w, c.lift_qpos] = 0.0
        physics.qvel[w, c.lift_dof] = 0.0
        q_WH = to_xyzw(physics.body_quat[w, c.hand])
        state.p_WG[w] = p_WH + wp.quat_rotate(q_WH, c.p_HG)


@wp.func
def judge_approach(
    c: Constants,
    bodies: Bodies,
    trials: Trials,
    state: WorldStates,
    physics: Physics,
    w: int,
    k: Check,
):
    """Goes on to the grasp, as long as nothing is touched."""
    q_WO = to_xyzw(physics.xquat[w, c.target])
    for i in range(bodies.corners.shape[0]):
        at = physics.xpos[w, c.target] + wp.quat_rotate(q_WO, bodies.corners[i])
        was = c.p_WO + wp.quat_rotate(c.q_WO, bodies.corners[i])
        state.pushed[w] = wp.max(state.pushed[w], wp.length(at - was))
    if state.hand_touches[w] == 1:
        return int(End.UNPLANNED_TOUCH)
    if state.in_phase[w] == trials.checks[k.trial, 0] + 1:
        state.phase[w] = CLOSE
        state.in_phase[w] = 0
        for i in range(2):
            physics.ctrl[w, c.finger_servo[i]] = c.closing_speed[i]
    return int(End.RUNNING)


@wp.func
def judge_close(
    c: Constants, trials: Trials, state: WorldStates, physics: Physics, w: int, k: Check
):
    """Closes until the fingers rest."""
    if k.some and state.touched[w] == 0:
        state.touched[w] = 1
    now = state.in_phase[w]
    speed = wp.max(
        wp.abs(physics.qvel[w, c.finger_dof[0]]), wp.abs(physics.qvel[w, c.finger_dof[1]])
    )
    if speed > c.settled_speed:
        state.slow_since[w] = NO_BODY
    else:
        state.slow_since[w] = wp.min(state.slow_since[w], now)
    if now < c.close_timeout and now - state.slow_since[w] < c.settled_checks:
        return int(End.RUNNING)
    if k.both:
        state.p_grip[w] = k.p_GO
        state.q_grip[w] = k.q_GO
        state.phase[w] = LIFT
        begin_segment(c, trials, state, physics, w, 1, c.approaches == 1)
        return int(End.RUNNING)
    if k.some:
        return int(End.ONE_FINGER)
    if state.touched[w] == 1:
        return int(End.CLOSED_EMPTY)
    return int(End.NO_CONTACT)


@wp.func
def is_decided(c: Constants, trials: Trials, state: WorldStates, w: int, k: Check):
    """Whether the target will be held to the end if the rest of the path is free; see
    `Execution`."""
    half = trials.checks[k.trial, k.last] / 2
    before = state.in_phase[w] - 1
    carries_full_load = before >= half + c.steady_checks
    if k.direction[2] >= 1.0:  # straight up, in single precision
        carries_full_load = before < half
    return (
        carries_full_load
        and k.both
        and k.is_steady
        and state.free_checks[w] >= c.steady_checks
        and k.followed + k.length - k.travelled >= MIN_LIFT_SHARE * k.path
        and is_stable(c, k, trials.time[k.trial] + c.hold_time)
    )


@wp.func
def judge_lift(
    c: Constants, trials: Trials, state: WorldStates, physics: Physics, w: int, k: Check
):
    """Goes on along the segments."""
    if k.blocker < NO_BODY:
        return int(End.BLOCKED)
    if not k.some:
        return int(End.SLIPPED)
    segment, checks = state.segment[w], trials.checks[k.trial, state.segment[w]]
    if segment < k.last:
        if state.in_phase[w] == checks + 1:  # In one more check the hand comes to rest.
            state.followed[w] = k.followed
            state.center_start[w] = physics.xipos[w, c.target]
            begin_segment(c, trials, state, physics, w, segment + 1, True)
        return int(End.RUNNING)
    if trials.early[k.trial] == 1 and is_decided(c, trials, state, w, k):
        return int(End.HELD_IF_FREE)
    if state.in_phase[w] == checks:
        if not k.both or k.followed < MIN_LIFT_SHARE * k.path:
            return int(End.SLIPPED)
        state.phase[w] = HOLD
        state.in_phase[w] = 0
        state.motion_count[w] = 0
    return int(End.RUNNING)


@wp.func
def judge_shake(trials: Trials, state: WorldStates, w: int, k: Check):
    """Goes on until the shaking is over."""
    if not k.some:
        return int(End.SLIPPED)
    if state.in_phase[w] < trials.checks[k.trial, 1]:
        return int(End.RUNNING)
    if k.both:
        return int(End.HELD)
    return int(End.SLIPPED)


@wp.func
def judge_hold(c: Constants, state: WorldStates, w: int, k: Check):
    """Waits at the end of the lift."""
    if k.blocker < NO_BODY:
        return int(End.BLOCKED)
    if not k.some:
        return int(End.DROPPED)
    over = state.in_phase[w] == c.hold_checks
    if not over and c.early == 1:
        over = k.is_steady and is_stable(c, k, c.hold_time)
    if not over:
        return int(End.RUNNING)
    if k.both:
        return int(End.HELD)
    return int(End.DROPPED)


@wp.func
def end_trial(
    c: Constants,
    bodies: Bodies,
    trials: Trials,
    state: WorldStates,
    physics: Physics,
    w: int,
    k: Check,
    end: int,
):
    """Writes how a trial has ended."""
    row = k.trial
    trials.end[row] = end
    trials.check[row] = k.number
    trials.slip[row] = k.slip
    trials.tilt[row] = k.tilt
    unit = wp.float64(FORCE_UNIT)
    trials.force[row] = wp.vec2(
        float(wp.float64(state.force[w, 0]) * unit), float(wp.float64(state.force[w, 1]) * unit)
    )
    trials.spheres[row] = wp.vec2i(state.spheres[w, 0], state.spheres[w, 1])
    trials.lift[row] = k.followed
    trials.left[row] = k.length - k.travelled
    trials.pushed[row] = state.pushed[w]
    trials.blocker[row] = k.blocker
    trials.p_WO[row] = physics.xpos[w, c.target]
    trials.q_WO[row] = to_xyzw(physics.xquat[w, c.target])
    trials.last_fingers[row] = wp.vec2(
        physics.qpos[w, c.finger_qpos[0]], physics.qpos[w, c.finger_qpos[1]]
    )
    trials.travelled[row] = k.travelled
    trials.p_WG[row] = state.p_WG[w]
    for i in range(bodies.others.shape[0]):
        other = bodies.others[i]
        trials.others_moved[row, i] = state.others_moved[w, i]
        trials.others_turned[row, i] = state.others_turned[w, i]
        trials.others_toppled[row, i] = state.others_over[w, i] * state.others_tilted[w, i]
        trials.others_p[row, i] = physics.xpos[w, other]
        trials.others_q[row, i] = to_xyzw(physics.xquat[w, other])


@wp.kernel(enable_backward=False)
def judge(
    c: Constants,
    bodies: Bodies,
    trials: Trials,
    state: WorldStates,
    physics: Physics,
    counts: Counts,
):
    """Evaluates the check of each world, and goes on to its next phase or ends its trial."""
    w = wp.tid()
    phase = state.phase[w]
    if phase == IDLE_PHASE:
        return
    wp.atomic_max(counts.rows, 0, physics.nefc[w])
    wp.atomic_max(counts.contacts, 0, wp.max(physics.nacon[0], physics.ncollision[0]))
    k = find(c, trials, state, physics, w)
    k = find_motion(c, state, physics, w, k)
    state.in_phase[w] = state.in_phase[w] + 1
    end = int(0)
    if (physics.overflow[w] & c.overflows) != 0:
        end = int(End.OVERFLOW)
    elif not wp.isfinite(physics.xipos[w, c.target][2]):
        end = int(End.NOT_FINITE)
    elif state.other[w] == 1:
        end = int(End.OTHER_TOUCHED)
    elif phase == APPROACH:
        end = judge_approach(c, bodies, trials, state, physics, w, k)
    elif c.approaches == 1 and k.blocker < NO_BODY:
        end = int(End.UNPLANNED_TOUCH)
    elif phase == CLOSE:
        end = judge_close(c, trials, state, physics, w, k)
    elif phase == LIFT and c.shakes == 1:
        end = judge_shake(trials, state, w, k)
    elif phase == LIFT:
        end = judge_lift(c, trials, state, physics, w, k)
    else:
        end = judge_hold(c, state, w, k)
    if end != int(End.RUNNING):
        end_trial(c, bodies, trials, state, physics, w, k, end)
        state.phase[w] = IDLE_PHASE
        wp.atomic_add(counts.done, 0, 1)
    elif k.both:
        keep_in_grip(c, state, physics, w)
    clear_check(state, w)


@wp.func
def clear_check(state: WorldStates, w: int):
    """Forgets the contacts of a check."""
    for finger in range(2):
        state.touch[w, finger] = 0
        state.force[w, finger] = wp.int64(0)
        state.spheres[w, finger] = 0
    state.outside[w] = 0
    state.other[w] = 0
    state.hand_touches[w] = 0
    state.blocker[w] = NO_BODY
    state.on_table[w] = 0
    state.others_step[w] = 0.0
