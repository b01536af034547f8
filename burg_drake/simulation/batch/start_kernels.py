"""Starts of trials on the device: `begin_trials` gives the next one to worlds that have none.

Annotations are not postponed, as Warp reads them.
"""

import warp as wp

from burg_drake.simulation.batch.device_arrays import (
    IDLE_PHASE,
    NO_BODY,
    Bodies,
    Constants,
    Counts,
    Masses,
    Physics,
    Trials,
    WorldStates,
)
from burg_drake.simulation.batch.trial_kernels import clear_check


@wp.func
def to_wxyz(q: wp.quat):
    """A quaternion of Warp, xyzw, as one of MuJoCo."""
    return wp.quat(q[3], q[0], q[1], q[2])


@wp.func
def combined_friction(a: wp.float64, b: wp.float64):
    """Friction coefficient that Drake uses for two surfaces."""
    if a + b <= wp.float64(0.0):
        return wp.float64(0.0)
    return wp.float64(2.0) * a * b / (a + b)


@wp.func
def set_surfaces(bodies: Bodies, trials: Trials, physics: Physics, w: int, trial: int):
    """Sets friction for the target's coefficient, and the stiffness of the pads for its mass."""
    mu = trials.friction[trial]
    for geom in range(physics.geom_friction.shape[1]):
        own = bodies.friction[geom]
        if own < wp.float64(0.0):
            physics.geom_friction[w, geom][0] = float(mu)
        else:
            physics.geom_friction[w, geom][0] = float(combined_friction(own, mu))
        if bodies.sphere[geom] >= 0:
            pad = trials.pads[trial, bodies.finger[geom]]
            physics.geom_solref[w, geom] = wp.vec2(pad[0], pad[1])
            physics.geom_solimp[w, geom][0] = pad[2]
            physics.geom_solimp[w, geom][1] = pad[2]
    for pair in range(physics.pair_friction.shape[1]):
        own = bodies.pair_friction[pair]
        if own >= wp.float64(0.0):
            both = float(combined_friction(own, mu))
            physics.pair_friction[w, pair][0] = both
            physics.pair_friction[w, pair][1] = both


@wp.func
def set_mass(c: Constants, masses: Masses, trials: Trials, physics: Physics, w: int, trial: int):
    """Sets the target's mass; its inertia scales with it."""
    mass = trials.mass[trial]
    ratio = mass / c.target_mass
    physics.body_mass[w, c.target] = mass
    physics.body_subtreemass[w, c.target] = mass
    physics.body_inertia[w, c.target] = masses.inertia * ratio
    physics.body_invweight0[w, c.target] = masses.mobility / ratio
    for k in range(6):
        physics.dof_invweight0[w, c.target_dof + k] = masses.dof_mobility[k] / ratio
    weight = c.gravity * mass
    physics.xfrc_applied[w, c.target] = wp.spatial_vector(
        weight[0], weight[1], weight[2], 0.0, 0.0, 0.0
    )


@wp.func
def set_start(c: Constants, bodies: Bodies, trials: Trials, physics: Physics, w: int, trial: int):
    """Sets hand, fingers and objects to the start of a trial."""
    way = trials.ways[trial, 1 - c.approaches]
    physics.body_pos[w, c.carrier] = trials.p_WH[trial]
    physics.body_quat[w, c.hand] = to_wxyz(trials.q_WH[trial])
    physics.jnt_axis[w, c.lift_joint] = wp.vec3(way[0], way[1], way[2])
    for i in range(physics.qpos.shape[1]):
        physics.qpos[w, i] = bodies.qpos[i]
    for i in range(physics.qvel.shape[1]):
        physics.qvel[w, i] = 0.0
        physics.qacc_warmstart[w, i] = 0.0
        physics.qfrc_applied[w, i] = 0.0
    for i in range(2):
        physics.qpos[w, c.finger_qpos[i]] = trials.fingers[trial][i]
        speed = c.closing_speed[i]
        if c.approaches == 1:
            physics.ctrl[w, c.finger_servo[i]] = -speed
        else:
            physics.ctrl[w, c.finger_servo[i]] = speed
            physics.qvel[w, c.finger_dof[i]] = speed
    physics.time[w] = 0.0
    physics.overflow[w] = 0


@wp.kernel(enable_backward=False)
def begin_trials(
    c: Constants,
    bodies: Bodies,
    masses: Masses,
    trials: Trials,
    state: WorldStates,
    physics: Physics,
    counts: Counts,
):
    """Gives the next trial to each world without one."""
    w = wp.tid()
    if state.phase[w] != IDLE_PHASE or counts.begun[0] >= trials.end.shape[0]:
        return
    trial = wp.atomic_add(counts.begun, 0, 1)
    if trial >= trials.end.shape[0]:
        return
    set_start(c, bodies, trials, physics, w, trial)
    set_surfaces(bodies, trials, physics, w, trial)
    set_mass(c, masses, trials, physics, w, trial)
    state.trial[w] = trial
    state.phase[w] = 1 - c.approaches
    state.segment[w] = 1 - c.approaches
    state.check[w] = 0
    state.in_phase[w] = 0
    state.step[w] = 0
    state.slow_since[w] = NO_BODY
    state.touched[w] = 0
    state.free_checks[w] = 0
    state.p_last[w] = trials.p_GO[trial]
    state.q_last[w] = trials.q_GO[trial]
    state.motion_count[w] = 0
    state.center_start[w] = c.center
    state.followed[w] = 0.0
    state.p_WG[w] = trials.p_WH[trial] + wp.quat_rotate(trials.q_WH[trial], c.p_HG)
    state.pushed[w] = 0.0
    for i in range(bodies.others.shape[0]):
        other = bodies.others[i]
        weight = c.gravity * physics.body_mass[w, other]
        physics.xfrc_applied[w, other] = wp.spatial_vector(
            weight[0], weight[1], weight[2], 0.0, 0.0, 0.0
        )
        state.others_moved[w, i] = 0.0
        state.others_turned[w, i] = 0.0
        state.others_over[w, i] = 0
        state.others_last[w, i] = bodies.others_center[i]
    for sphere in range(state.seen.shape[1]):
        state.seen[w, sphere] = 0
    clear_check(state, w)
