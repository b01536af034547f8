"""Motion: one rigid object, two fingers, a hand that rises, stepped by semi-implicit Euler.

Everything is in the axes of the grasp frame G, which rises with the hand: its acceleration adds to
gravity, and the table sinks.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .arrays import Array
from .compiled import compiled
from .foundation import ROWS, press_pad, press_table

MARGIN = 5e-4
"""Samples so close to a surface are in its list [m], which holds until something moved so far."""
DEEPEST = 7.6e-3
"""A pad is an elastic foundation down to its middle [m]."""
TABLE = 2
TINY = 1e-25


@dataclass
class State:
    """What moves.

    Attributes:
        body: (18,) see `press_pad`.
        spin: (3,) angular momentum of the object.
        fingers: (2, 2) distance of each pad from the middle [m], and its rate [m/s].
        hand: (2,) height above the start [m], speed [m/s].
        near: (3, ROWS, n) samples near the first pad, the second pad and the table.
        counts: (3,) how many they are.
        kept: bristles of all samples for each of the pads, and of all feet: (3, n), (3, n), (3, m).
        drift: (4,) how far things have moved since the lists were made: in the hand, over the
            table, and how far they may [m].
        forces: (3,) of the pads and the table along their normals [N].
    """

    body: Array
    spin: Array
    fingers: Array
    hand: Array
    near: Array
    counts: Array
    kept: tuple[Array, Array, Array]
    drift: Array = field(default_factory=lambda: np.array((1.0, 1.0, 0.0, 0.0)))
    forces: Array = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def at(cls, p: Array, R: Array, distances: Array, samples: int, feet: int) -> State:
        """All at rest: centre of mass (3,), rotation (3, 3), distances of the pads (2,)."""
        body = np.zeros(18)
        body[:3], body[3:12] = p, R.ravel()
        return cls(
            body,
            np.zeros(3),
            np.stack((distances, np.zeros(2)), axis=1),
            np.zeros(2),
            np.zeros((3, ROWS, max(samples, feet))),
            np.zeros(3, np.int64),
            (np.zeros((3, samples)), np.zeros((3, samples)), np.zeros((3, feet))),
        )


@dataclass(frozen=True)
class World:
    """What does not change in a trial.

    Attributes:
        samples: (7, n) point and normal from the centre of mass in the object's axes, area: those
            that pads may touch.
        feet: (7, m) coarser ones that the table may touch.
        mass: [kg], and of one finger.
        inverse_inertia: (3, 3) in the object's axes, about the centre of mass.
        front: see `press_pad`.
        pad_material, table_material: (4,) see `press_pad`.
        up: (3,) the world's z axis in G.
        table: height of the table along it, before the lift [m].
        gravity: [m/s^2].
        servo: (4,) wanted speed of the fingers (negative: closing) [m/s], gain [N s/m], force [N],
            and 1 if one drive moves both fingers.
        step: [s].
    """

    samples: Array
    feet: Array
    mass: tuple[float, float]
    inverse_inertia: Array
    front: Array
    pad_material: Array
    table_material: Array
    up: Array
    table: float
    gravity: float
    servo: Array
    step: float

    def advance(self, state: State, steps: int, acceleration: float = 0.0) -> None:
        """Steps, while the hand accelerates upwards [m/s^2]."""
        moving = (state.body, state.spin, state.fingers, state.hand, state.forces)
        lists = (state.near, state.counts, state.kept, state.drift)
        constants = (*self.mass, self.table, self.gravity, acceleration, self.step)
        arrays = (self.inverse_inertia, self.front, self.up, self.servo)
        materials = (self.pad_material, self.table_material)
        _advance(moving, lists, (self.samples, self.feet), constants, arrays, materials, steps)


@compiled
def _advance(moving, lists, samples, constants, arrays, materials, steps):  # type: ignore[no-untyped-def]
    body, spin, fingers, hand, forces = moving
    points, feet = samples
    near, counts, kept, drift = lists
    mass, finger_mass, table, gravity, acceleration, step = constants
    inverse_inertia, front, up, servo = arrays
    radius = 0.0
    for k in range(feet.shape[1]):
        radius = max(radius, feet[0, k] ** 2 + feet[1, k] ** 2 + feet[2, k] ** 2)
    radius = np.sqrt(radius)
    plane = np.zeros(5)
    plane[:3] = up
    total = np.zeros(7)
    pushed = np.zeros(2)
    for _ in range(steps):
        plane[3], plane[4] = table - hand[0], -hand[1]
        if drift[0] > drift[2]:
            _list_near_pads(near, counts, kept, points, body, fingers, front)
            drift[0], drift[2] = 0.0, MARGIN
        if drift[1] > drift[3]:
            gap = _list_near_table(near, counts, kept[2], feet, body, plane)
            drift[1], drift[3] = 0.0, max(MARGIN, gap)
        total[:] = 0.0
        for k in range(2):
            total[6] = 0.0
            side = 1.0 - 2.0 * k
            if counts[k] > 0:
                press_pad(
                    near[k], counts[k], body, side, fingers[k], front, materials[0], step, total
                )
            pushed[k] = forces[k] = total[6]
        total[6] = 0.0
        if counts[TABLE] > 0:
            press_table(near[TABLE], counts[TABLE], body, plane, materials[1], step, total)
        forces[TABLE] = total[6]
        _move_fingers(fingers, pushed, servo, finger_mass, step)
        for k in range(3):
            body[12 + k] += step * (total[k] / mass - (gravity + acceleration) * up[k])
            spin[k] += step * total[3 + k]
            # What has died away would go on in denormal numbers, which are slow.
            body[12 + k] = body[12 + k] if abs(body[12 + k]) > TINY else 0.0
            spin[k] = spin[k] if abs(spin[k]) > TINY else 0.0
        _turn(body, spin, inverse_inertia, step)
        hand[1] += step * acceleration
        hand[0] += step * hand[1]
        v, w, relative = 0.0, 0.0, 0.0
        for k in range(3):
            body[k] += step * body[12 + k]
            v += body[12 + k] ** 2
            w += body[15 + k] ** 2
            relative += (body[12 + k] + hand[1] * up[k]) ** 2
        turning = np.sqrt(w) * radius
        fastest = max(abs(fingers[0, 1]), abs(fingers[1, 1]))
        drift[0] += step * (np.sqrt(v) + turning + fastest)
        drift[1] += step * (np.sqrt(relative) + turning)


@compiled
def _move_fingers(fingers, pushed, servo, mass, step):  # type: ignore[no-untyped-def]
    """Servos are stiff: their force is that of the speed at the end of the step, within limits."""
    wanted, gain, limit, coupled = servo[0], servo[1], servo[2], servo[3]
    if coupled > 0.0:
        middle = 0.5 * (pushed[0] + pushed[1])
        pushed[0] = pushed[1] = middle
    for k in range(2):
        free = fingers[k, 1] + step / mass * pushed[k]
        share = step / mass * gain
        rate = (free + share * wanted) / (1.0 + share)
        force = gain * (wanted - rate)
        if abs(force) > limit:
            rate = free + step / mass * (limit if force > 0.0 else -limit)
        fingers[k, 1] = rate
        fingers[k, 0] += step * rate


@compiled
def _turn(body, spin, inverse_inertia, step):  # type: ignore[no-untyped-def]
    """Angular velocity from momentum, and the rotation by it."""
    R = body[3:12].reshape(3, 3)
    w = R @ (inverse_inertia @ (R.T @ spin))
    body[15:18] = w
    angle = np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2) * step
    if angle < 1e-15:
        return
    x, y, z = w[0] * step / angle, w[1] * step / angle, w[2] * step / angle
    sin, cos = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    for k in range(3):
        a, b, c = R[0, k], R[1, k], R[2, k]
        along = x * a + y * b + z * c
        body[3 + k] = a + sin * (y * c - z * b) + cos * (x * along - a)
        body[6 + k] = b + sin * (z * a - x * c) + cos * (y * along - b)
        body[9 + k] = c + sin * (x * b - y * a) + cos * (z * along - c)


@compiled
def _keep(near, counts, kept, surface):  # type: ignore[no-untyped-def]
    """Writes the bristles of a list back."""
    for k in range(counts[surface]):
        number = int(near[surface, 10, k])
        for j in range(3):
            kept[j, number] = near[surface, 7 + j, k]


@compiled
def _add(near, counts, kept, samples, surface, number):  # type: ignore[no-untyped-def]
    """Adds a sample to a list."""
    k = counts[surface]
    for j in range(7):
        near[surface, j, k] = samples[j, number]
    for j in range(3):
        near[surface, 7 + j, k] = kept[j, number]
    near[surface, 10, k] = number
    counts[surface] = k + 1


@compiled
def _list_near_pads(near, counts, kept, samples, body, fingers, front):  # type: ignore[no-untyped-def]
    _keep(near, counts, kept[0], 0)
    _keep(near, counts, kept[1], 1)
    counts[0] = counts[1] = 0
    R = body[3:12].reshape(3, 3)
    for n in range(samples.shape[1]):
        sx, sy, sz = samples[0, n], samples[1, n], samples[2, n]
        y = body[1] + R[1, 0] * sx + R[1, 1] * sy + R[1, 2] * sz
        z = body[2] + R[2, 0] * sx + R[2, 1] * sy + R[2, 2] * sz
        if (
            abs(y) > front[0] + front[3] + MARGIN
            or abs(z - front[2]) > front[1] + front[3] + MARGIN
        ):
            continue
        x = body[0] + R[0, 0] * sx + R[0, 1] * sy + R[0, 2] * sz
        nx = R[0, 0] * samples[3, n] + R[0, 1] * samples[4, n] + R[0, 2] * samples[5, n]
        for k in range(2):
            side = 1.0 - 2.0 * k
            depth = side * x - fingers[k, 0]
            if -MARGIN < depth < DEEPEST and side * nx > -0.1:
                _add(near, counts, kept[0] if k == 0 else kept[1], samples, k, n)


@compiled
def _list_near_table(near, counts, kept, samples, body, plane):  # type: ignore[no-untyped-def]
    """Returns the gap between the object and the table [m]."""
    _keep(near, counts, kept, TABLE)
    counts[TABLE] = 0
    R = body[3:12].reshape(3, 3)
    u = R.T @ plane[:3]
    above = plane[0] * body[0] + plane[1] * body[1] + plane[2] * body[2] - plane[3]
    lowest = 1.0
    for n in range(samples.shape[1]):
        gap = above + u[0] * samples[0, n] + u[1] * samples[1, n] + u[2] * samples[2, n]
        lowest = min(lowest, gap)
        if gap < MARGIN:
            facing = u[0] * samples[3, n] + u[1] * samples[4, n] + u[2] * samples[5, n]
            if facing < 0.2:
                _add(near, counts, kept, samples, TABLE, n)
    return lowest
