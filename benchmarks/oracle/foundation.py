"""Contact: samples of an object's surface in an elastic foundation, each with a bristle.

A sample of the surface that is `depth` deep in a pad feels the pressure `stiffness * depth` along
its own normal, as the deformed pad lies along the object: its part along the pad's normal is that
pressure on the area as seen from the front. Its bristle is the tangential displacement since it
stuck; it pulls back in proportion, and slips where that is beyond Coulomb's limit. All samples near
a surface are worked off in one loop without branches, which the compiler turns into vector
instructions; that, and the list of near samples, make a trial of 45 000 steps take a second.

Damping is Hunt and Crossley's: the pressure times 1 + dissipation * speed of approach. It has to be
low. The friction limit follows the damped pressure, so that an object that pivots, and moves
through the pads at some cm/s, would be held by damping rather than by the grip: at 5 s/m and
0.02 m/s the pressure is 10 % off the elastic one, at 50 s/m it is double.
"""

from __future__ import annotations

import numpy as np

from .arrays import Array
from .compiled import compiled, unsigned

ROWS = 11
"""Of a list of near samples: point (3) and normal (3) from the centre of mass in the object's axes,
area, bristle (3), number of the sample."""
BRISTLE_TIME = 1e-4
"""Damping of a bristle, over its stiffness [s]: a tenth of critical for a usual object."""


@compiled
def press_pad(
    near: Array,
    count: int,
    body: Array,
    side: float,
    pad: Array,
    front: Array,
    material: Array,
    step: float,
    total: Array,
) -> None:
    """Adds the force of one pad.

    Args:
        near: (ROWS, n) samples near the pad; their bristles are moved on.
        count: how many of them there are.
        body: (18,) position (3), rotation (9, row by row), velocity (3), angular velocity (3).
        side: 1 or -1: the pad on the side of +x or of -x.
        pad: (2,) distance of the front from the middle [m], and its rate [m/s].
        front: (4,) half sizes along y and z, middle along z, spacing of samples [m].
        material: (4,) stiffness, of bristles too [N/m^3], friction, dissipation [s/m].
        step: [s].
        total: (7,) force and moment about the centre of mass on the object, opening force on the
            pad.
    """
    px, py, pz = body[0], body[1], body[2]
    a, b, c, d, e, f, g, h, i = body[3:12]
    vx, vy, vz, wx, wy, wz = body[12:18]
    distance, opening = pad[0], pad[1]
    half_y, half_z, middle, spacing = front[0], front[1], front[2], front[3]
    stiffness, bristle, friction, dissipation = material[0], material[1], material[2], material[3]
    fx, fy, fz, mx, my, mz, out = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x, y, z, n1, n2, n3, cells = near[0], near[1], near[2], near[3], near[4], near[5], near[6]
    b1, b2, b3 = near[7], near[8], near[9]
    for k in range(unsigned(count)):
        sx, sy, sz = x[k], y[k], z[k]
        rx = a * sx + b * sy + c * sz
        ry = d * sx + e * sy + f * sz
        rz = g * sx + h * sy + i * sz
        nx = a * n1[k] + b * n2[k] + c * n3[k]
        ny = d * n1[k] + e * n2[k] + f * n3[k]
        nz = g * n1[k] + h * n2[k] + i * n3[k]
        depth = max(side * (px + rx) - distance, 0.0)
        # The part of the sample's cell that is over the front.
        over_y = min(max((half_y - abs(py + ry)) / spacing + 0.5, 0.0), 1.0)
        over_z = min(max((half_z - abs(pz + rz - middle)) / spacing + 0.5, 0.0), 1.0)
        over = over_y * over_z if side * nx > 0.0 else 0.0
        area = cells[k] * over
        ux = vx + wy * rz - wz * ry - side * opening
        uy = vy + wz * rx - wx * rz
        uz = vz + wx * ry - wy * rx
        pressure = max(stiffness * depth * (1.0 + dissipation * side * ux), 0.0)
        touches = 1.0 if depth * over > 0.0 else 0.0
        normal = ux * nx + uy * ny + uz * nz
        ux, uy, uz = ux - normal * nx, uy - normal * ny, uz - normal * nz
        bx = touches * (b1[k] + step * ux)
        by = touches * (b2[k] + step * uy)
        bz = touches * (b3[k] + step * uz)
        normal = bx * nx + by * ny + bz * nz
        bx, by, bz = bx - normal * nx, by - normal * ny, bz - normal * nz
        tx = bristle * (bx + BRISTLE_TIME * ux)
        ty = bristle * (by + BRISTLE_TIME * uy)
        tz = bristle * (bz + BRISTLE_TIME * uz)
        limit = friction * pressure
        pull = np.sqrt(tx * tx + ty * ty + tz * tz) + 1e-30
        share = min(1.0, limit / pull)
        slips = 1.0 if share < 1.0 else 0.0
        tx, ty, tz = share * tx, share * ty, share * tz
        b1[k] = slips * tx / bristle + (1.0 - slips) * bx
        b2[k] = slips * ty / bristle + (1.0 - slips) * by
        b3[k] = slips * tz / bristle + (1.0 - slips) * bz
        gx = -(pressure * nx + tx) * area
        gy = -(pressure * ny + ty) * area
        gz = -(pressure * nz + tz) * area
        fx, fy, fz = fx + gx, fy + gy, fz + gz
        mx += ry * gz - rz * gy
        my += rz * gx - rx * gz
        mz += rx * gy - ry * gx
        out -= side * gx
    total[0] += fx
    total[1] += fy
    total[2] += fz
    total[3] += mx
    total[4] += my
    total[5] += mz
    total[6] += out


@compiled
def press_table(
    near: Array,
    count: int,
    body: Array,
    plane: Array,
    material: Array,
    step: float,
    total: Array,
) -> None:
    """Adds the force of the table, a plane: normal to it, and friction along it.

    Over a closed surface in a pressure that grows with depth alone, sideways parts of the pressure
    add up to nothing, as in water; so only the upward one is counted, which is right for coarse
    samples of edges, too.

    Args:
        near, count, body, material, step: as for a pad.
        plane: (5,) unit normal (3), height along it [m], and its rate [m/s].
        total: (7,) force and moment about the centre of mass on the object, pressing force.
    """
    px, py, pz = body[0], body[1], body[2]
    a, b, c, d, e, f, g, h, i = body[3:12]
    vx, vy, vz, wx, wy, wz = body[12:18]
    nx, ny, nz, height, rising = plane[0], plane[1], plane[2], plane[3], plane[4]
    stiffness, bristle, friction, dissipation = material[0], material[1], material[2], material[3]
    fx, fy, fz, mx, my, mz, out = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x, y, z, n1, n2, n3, cells = near[0], near[1], near[2], near[3], near[4], near[5], near[6]
    b1, b2, b3 = near[7], near[8], near[9]
    for k in range(unsigned(count)):
        sx, sy, sz = x[k], y[k], z[k]
        rx = a * sx + b * sy + c * sz
        ry = d * sx + e * sy + f * sz
        rz = g * sx + h * sy + i * sz
        ox = a * n1[k] + b * n2[k] + c * n3[k]
        oy = d * n1[k] + e * n2[k] + f * n3[k]
        oz = g * n1[k] + h * n2[k] + i * n3[k]
        depth = max(height - nx * (px + rx) - ny * (py + ry) - nz * (pz + rz), 0.0)
        area = cells[k] * max(-(ox * nx + oy * ny + oz * nz), 0.0)
        ux = vx + wy * rz - wz * ry - rising * nx
        uy = vy + wz * rx - wx * rz - rising * ny
        uz = vz + wx * ry - wy * rx - rising * nz
        normal = ux * nx + uy * ny + uz * nz
        pressure = max(stiffness * depth * (1.0 - dissipation * normal), 0.0)
        touches = 1.0 if depth * area > 0.0 else 0.0
        ux, uy, uz = ux - normal * nx, uy - normal * ny, uz - normal * nz
        bx = touches * (b1[k] + step * ux)
        by = touches * (b2[k] + step * uy)
        bz = touches * (b3[k] + step * uz)
        tx = bristle * (bx + BRISTLE_TIME * ux)
        ty = bristle * (by + BRISTLE_TIME * uy)
        tz = bristle * (bz + BRISTLE_TIME * uz)
        pull = np.sqrt(tx * tx + ty * ty + tz * tz) + 1e-30
        share = min(1.0, friction * pressure / pull)
        slips = 1.0 if share < 1.0 else 0.0
        tx, ty, tz = share * tx, share * ty, share * tz
        b1[k] = slips * tx / bristle + (1.0 - slips) * bx
        b2[k] = slips * ty / bristle + (1.0 - slips) * by
        b3[k] = slips * tz / bristle + (1.0 - slips) * bz
        gx = (pressure * nx - tx) * area
        gy = (pressure * ny - ty) * area
        gz = (pressure * nz - tz) * area
        fx, fy, fz = fx + gx, fy + gy, fz + gz
        mx += ry * gz - rz * gy
        my += rz * gx - rx * gz
        mz += rx * gy - ry * gx
        out += pressure * area
    total[0] += fx
    total[1] += fy
    total[2] += fz
    total[3] += mx
    total[4] += my
    total[5] += mz
    total[6] += out
