"""Contact patches of the two compliant pads of a parallel hand on an object, for grasps in batch.

Each pad is a Winkler foundation (Johnson, "Contact Mechanics", 1985, section 4.3): independent
springs over a flat face, pressed in against the rigid object until they carry the hand's force.
The object turns by small angles until the pressures of both pads face each other. There is no
rotation about the closing axis, and friction does not resist the rotation.

Where faces are steeper than the friction cone, the pads squeeze the object out: a bottle grasped at
its shoulder slides until the pads are on its cap. It moves along the pads, without inertia; its
weight and the table are left out. Of 344 grasps on scans of a bottle and a can that a trial lifted,
165 slide here, and 147 of these moved by more than 1 mm in the trial.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from burg_drake.core import NO_PACKAGES, Array, Indices, InvalidInputError, Packages, make_pose
from burg_drake.geometry import Surface

if TYPE_CHECKING:
    from burg_drake.station import Hand

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Jaws:
    """Two flat, compliant pads that close symmetrically along x of the grasp frame G.

    Attributes:
        opening: smallest and largest distance between the pads [m].
        force: normal force of each pad [N].
        y, z: extents of the pads' faces along y and z of G [m].
        foundation: pressure of a pad per indentation [Pa/m]: elastic modulus over the thickness of
            the elastic layer.
    """

    opening: Interval
    force: float
    y: Interval
    z: Interval
    foundation: float

    def __post_init__(self) -> None:
        for name in ("opening", "y", "z"):
            low, high = getattr(self, name)
            if not low < high:
                raise InvalidInputError(
                    f"Jaws.{name} goes from {low:g} to {high:g} m; the second number must be"
                    " the larger one"
                )
        if self.opening[0] < 0.0:
            raise InvalidInputError(f"Jaws.opening starts at {self.opening[0]:g} m; give 0 or more")
        for name in ("force", "foundation"):
            if not getattr(self, name) > 0.0:
                raise InvalidInputError(f"Jaws.{name} is {getattr(self, name):g}; give more than 0")

    @property
    def pad_area(self) -> float:
        """Area of a pad's face [m^2]."""
        return (self.y[1] - self.y[0]) * (self.z[1] - self.z[0])


PANDA_JAWS = Jaws(
    opening=(0.0, 0.08),
    force=40.0,
    y=(-0.00875, 0.00875),
    z=(-0.009, 0.0095),
    foundation=1e7 / 0.0076,
)
"""The Franka Hand: rubber tips 17.5 x 15.2 x 18.5 mm (franka_hand.xacro), 40 N."""


def jaws_of(hand: Hand, path: Path, packages: Packages = NO_PACKAGES) -> Jaws:
    """Reads the jaws of a hand.

    Args:
        hand: the document.
        path: the hand's model file.
        packages: the packages of the station.

    Raises:
        InvalidInputError: the document does not fit the model.
    """
    from burg_drake.station import check_hand

    figures = check_hand(hand, path, packages=packages)
    (_, y_low, z_low), (_, y_high, z_high) = figures.pad_bounds
    return Jaws(
        opening=hand.opening,
        force=hand.force,
        y=(y_low, y_high),
        z=(z_low, z_high),
        foundation=figures.pad_stiffness,
    )


TURN_RESISTANCE = 1e-3
"""Ratio of the added rotational stiffness to that of a full pad. It makes the angle unique."""


def press_pads(gap: Array, yz: Array, total: float) -> tuple[Array, Array]:
    """Presses both pads in.

    The object's angles minimise the energy of the springs, which is convex in them.

    Args:
        gap: (N, 2, K) distance of each spring from the object when its pad first touches [m].
        yz: (2, K, 2) positions of the springs on the pads' faces [m].
        total: sum of the indentations of a pad [m].

    Returns:
        (N, 2, K) indentations, at least 0 [m], and (N, 2) angles of the object about -z and y, as
        slopes of x along y and z [rad].
    """
    max_angle = 0.35  # Radians. Small-angle formulas are 6 % off there.
    y, z = (np.ascontiguousarray(np.stack([yz[0], -yz[1]])[..., c]) for c in (0, 1))
    resistance = TURN_RESISTANCE * float((yz[0] ** 2).sum())
    angle, share = np.zeros((len(gap), 2)), np.ones(len(gap))
    best, depth = _press_in(gap, total)
    lowest = _energy(best, depth, total)
    # With more than 10 Newton steps, fewer than one grasp in a thousand changes.
    for _ in range(10):
        step = share[:, None] * _newton_step(best, y, z, angle, resistance)
        trial = np.clip(angle + step, -max_angle, max_angle)
        pressed, depth = _press_in(gap - _rise_of_springs(trial, y, z), total)
        energy = _energy(pressed, depth, total) + 0.5 * resistance * (trial**2).sum(axis=1)
        better = energy < lowest
        lowest = np.where(better, energy, lowest)
        angle = np.where(better[:, None], trial, angle)
        best = np.where(better[:, None, None], pressed, best)
        share = np.where(better, np.minimum(1.0, 2.0 * share), 0.25 * share)
    return best, angle


def _press_in(gap: Array, total: float) -> tuple[Array, Array]:
    """Indentations (N, 2, K) that add up to `total`, and travels of the pads (N, 2) [m]."""
    order = np.sort(gap, axis=-1)
    depth = (total + np.cumsum(order, axis=-1)) / np.arange(1, gap.shape[-1] + 1)
    bearing = (depth > order).sum(axis=-1, keepdims=True)  # true up to the last spring that bears
    depth = np.take_along_axis(depth, bearing - 1, axis=-1)
    return np.maximum(depth - gap, 0.0), depth[..., 0]


def _rise_of_springs(angle: Array, y: Array, z: Array) -> Array:
    """(N, 2, K) motion of the object's surface towards each spring when it turns."""
    a, b = (angle[:, c, None, None] for c in (0, 1))
    return np.asarray(a * y + b * z)


def _energy(pressed: Array, depth: Array, total: float) -> Array:
    """(N,) potential energy of springs of unit stiffness and of the forces on the pads."""
    return np.asarray(0.5 * _sum_springs(pressed * pressed) - total * (depth[:, 0] + depth[:, 1]))


def _newton_step(pressed: Array, y: Array, z: Array, angle: Array, resistance: float) -> Array:
    """(N, 2) Newton step of the angles towards least energy, with the pads following the object."""
    bears = (pressed > 0.0).astype(float)
    count = bears.sum(axis=2)
    my, mz = (bears * y).sum(axis=2), (bears * z).sum(axis=2)

    def spread(product: Array, one: Array, other: Array) -> Array:
        return _sum_springs(bears * product) - (one * other / count).sum(axis=1)

    a = spread(y * y, my, my) + resistance
    b = spread(y * z, my, mz)
    d = spread(z * z, mz, mz) + resistance
    p, q = (_sum_springs(pressed * v) + resistance * angle[:, c] for c, v in enumerate((y, z)))
    return np.asarray(np.stack([b * q - d * p, b * p - a * q], axis=1) / (a * d - b * b)[:, None])


def _sum_springs(values: Array) -> Array:
    """(N,) sums over (N, 2, K), row by row, so that results do not depend on the batch."""
    one, two = values[:, 0].sum(axis=1), values[:, 1].sum(axis=1)
    return np.asarray(one + two)


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contact patches of N grasps; the pad on the side of +x of G is first.

    Attributes:
        touching: (N,) whether both pads touch, facing each other; all other arrays are NaN if not.
        p_OC: (N, 2, 3) centres of pressure on the object's surface [m].
        normal: (N, 2, 3) mean inward normals in the object frame, weighted by pressure; unit.
        area: (N, 2) areas of the patches, as the pad's face sees them [m^2].
        torsion_radius: (N, 2) mean distance from the centre of pressure, weighted by pressure [m].
            Times normal force and friction it is the torque that turns the patch in place.
        indentation: (N, 2) largest indentations of the pads [m].
    """

    touching: NDArray[np.bool_]
    p_OC: Array
    normal: Array
    area: Array
    torsion_radius: Array
    indentation: Array

    def select(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> Contacts:
        """Selects grasps by index or mask."""
        return Contacts(*(getattr(self, field.name)[index] for field in fields(self)))

    @property
    def radius(self) -> Array:
        """(N, 2) radii of circles with the area of the patches [m]."""
        return np.asarray(np.sqrt(self.area / np.pi))


def grasp_contacts(surface: Surface, X_OG: Array, jaws: Jaws = PANDA_JAWS) -> Contacts:
    """Closes the jaws on an object.

    G need not lie midway between the contacts. Faces that a pad would meet from behind, as when the
    open pad is inside the object, are ignored.

    Args:
        surface: surface of the object, in its frame O.
        X_OG: (N, 4, 4) grasps.
        jaws: the hand.
    """
    chunk_size = 1024  # Grasps evaluated together. Bounds the memory.
    parts = [
        _find_contacts(surface, np.asarray(X_OG[i : i + chunk_size], float), jaws)
        for i in range(0, max(len(X_OG), 1), chunk_size)
    ]
    names = [field.name for field in fields(Contacts)]
    return Contacts(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def friction_needed(contacts: Contacts) -> Array:
    """(N,) smallest friction coefficient that holds the grasps: the tangent of the larger angle
    between inward normals and the line through both contacts.

    Infinite from 90 degrees, NaN unless both pads touch.
    """
    angle = largest_angle(contacts.normal, contacts.p_OC[:, 1] - contacts.p_OC[:, 0])
    return np.asarray(np.where(angle < 0.5 * np.pi, np.tan(angle), np.inf) + 0.0 * angle)


def antipodal_angle(contacts: Contacts, X_OG: Array) -> Array:
    """(N,) larger of the angles between the closing directions of grasps (N, 4, 4), before the
    object turns, and the inward normals [rad]; NaN unless both pads touch."""
    return largest_angle(contacts.normal, -X_OG[:, :3, 0])


def are_antipodal(contacts: Contacts, X_OG: Array, friction: float) -> NDArray[np.bool_]:
    """(N,) whether both pads of grasps (N, 4, 4) touch, and the closing direction and the line
    through the contacts lie in the friction cones of both."""
    in_cones = antipodal_angle(contacts, X_OG) <= np.arctan(friction)
    return np.asarray(in_cones & (friction_needed(contacts) <= friction))


def largest_angle(normal: Array, line: Array) -> Array:
    """(N,) larger of the angles between normals (N, 2, 3) and the line (N, 3) from each contact to
    the other [rad]; `line` points from the first to the second."""
    towards = np.stack([line, -line], axis=1)
    sine = np.linalg.norm(np.cross(normal, towards), axis=-1)
    return np.asarray(np.arctan2(sine, (normal * towards).sum(axis=-1)).max(axis=1))


def _find_contacts(surface: Surface, X_OG: Array, jaws: Jaws) -> Contacts:
    first = _PadTouch.of(surface, X_OG, jaws)
    touch = _PadTouch.of(surface, _turn_object(X_OG, first), jaws)
    p_GC, weight, where = touch.p_GC, touch.weight, touch.touching
    normal = -(weight[..., None] * surface.normals[touch.face]).sum(axis=2)
    lever = touch.yz[None] - p_GC[:, :, None, 1:]
    # a spring represents its cell, whose points have a mean squared distance of cell / 2 pi from it
    square = (lever**2).sum(axis=-1) + touch.cell / (2.0 * np.pi)
    found = (
        _rotate(touch.X_OG, p_GC) + touch.X_OG[:, None, :3, 3],
        normal / np.linalg.norm(normal, axis=-1, keepdims=True),
        (touch.pressed > 0.0).sum(axis=2) * touch.cell,
        _weighted_mean(weight, np.sqrt(square)),
        touch.pressed.max(axis=2),
    )
    return Contacts(where, *(_scatter_rows(values, where) for values in found))


@dataclass(frozen=True, eq=False)
class _PadTouch:
    """Contact of the pads in M of N grasps at the given poses.

    Attributes:
        touching: (N,) whether both pads touch; the M grasps.
        X_OG: (M, 4, 4) their poses.
        yz: (2, K, 2) positions of the springs on the pads' faces [m].
        cell: area that a spring represents [m^2].
        face: (M, 2, K) faces that the springs meet.
        pressed: (M, 2, K) indentations of the springs [m].
        weight: (M, 2, K) shares of the springs in a pad's force.
        p_GC: (M, 2, 3) centres of pressure [m].
        slope: (M, 2) rotation of the object, as slopes of x along y and z.
    """

    touching: NDArray[np.bool_]
    X_OG: Array
    yz: Array
    cell: float
    face: Indices
    pressed: Array
    weight: Array
    p_GC: Array
    slope: Array

    @classmethod
    def of(cls, surface: Surface, X_OG: Array, jaws: Jaws) -> _PadTouch:
        yz, cell = _springs(jaws)
        face, distance = _cast_springs(surface, X_OG, yz, jaws)
        first = distance.min(axis=2)
        touching = np.isfinite(first).all(axis=1)
        width = jaws.opening[1] - first.sum(axis=1)
        touching &= width > max(jaws.opening[0], surface.rays.offset)
        face, distance, first = face[touching], distance[touching], first[touching]
        met = face >= 0
        gap = np.where(met, distance, 1e3) - first[:, :, None]
        pressed, slope = press_pads(gap, yz, jaws.force / (jaws.foundation * cell))
        weight = pressed / pressed.sum(axis=2, keepdims=True)
        x = (0.5 * jaws.opening[1] - np.where(met, distance, 0.0)) * np.array([[1.0], [-1.0]])
        p_GC = np.stack([_weighted_mean(weight, v) for v in (x, yz[..., 0], yz[..., 1])], axis=-1)
        return cls(touching, X_OG[touching], yz, cell, face, pressed, weight, p_GC, slope)


def _turn_object(X_OG: Array, touch: _PadTouch) -> Array:
    """The grasps (N, 4, 4) after the object has turned about the middle between the contacts."""
    zero = np.zeros(len(touch.slope))
    turn = np.stack([zero, -touch.slope[:, 1], touch.slope[:, 0]], axis=-1)
    X_GT = make_pose(Rotation.from_rotvec(turn).as_matrix())
    middle = touch.p_GC.mean(axis=1)
    X_GT[:, :3, 3] = middle - _rotate(X_GT, middle[:, None])[:, 0]
    turned = X_OG.copy()
    turned[touch.touching] = sum(touch.X_OG[:, :, k, None] * X_GT[:, None, k] for k in range(4))
    return turned


def _scatter_rows(values: Array, where: NDArray[np.bool_]) -> Array:
    """Values (N, ...): `values` (M, ...) at the M grasps in `where`, NaN at the others."""
    full = np.full((len(where), *values.shape[1:]), np.nan)
    full[where] = values
    return full


def _springs(jaws: Jaws) -> tuple[Array, float]:
    """Positions of the springs (2, K, 2) along y and z of G [m], and the area that a spring
    represents [m^2]. The second pad's springs are the first pad's after half a turn about z."""
    spring_count = 55  # Springs of a pad, in a Fibonacci lattice, evenly spaced along edges.
    lattice_step = 34  # Step of the lattice.
    i = np.arange(spring_count)
    share = np.stack([i + 0.5, i * lattice_step % spring_count + 0.5], axis=-1) / spring_count
    low, high = np.array([jaws.y, jaws.z]).T
    first = low + share * (high - low)
    turned = np.stack([-first[:, 0], first[:, 1]], axis=-1)
    return np.stack([first, turned]), jaws.pad_area / spring_count


def _cast_springs(surface: Surface, X_OG: Array, yz: Array, jaws: Jaws) -> tuple[Indices, Array]:
    """Faces that the springs meet (N, 2, K), -1 for none, and distances from the open pad [m]."""
    half = 0.5 * jaws.opening[1]
    x = np.broadcast_to(np.array([[half], [-half]])[:, :, None], (*yz.shape[:2], 1))
    p_GS = np.concatenate([x, yz], axis=-1).reshape(-1, 3)
    p_OS = _rotate(X_OG, p_GS) + X_OG[:, None, :3, 3]
    closing = X_OG[:, None, None, :3, 0] * np.array([-1.0, 1.0])[:, None, None]
    direction = np.broadcast_to(closing, (len(X_OG), *yz.shape[:2], 3)).reshape(-1, 3)
    face, distance = surface.rays.first_hits(p_OS.reshape(-1, 3), direction, jaws.opening[1])
    from_behind = np.einsum("ij,ij->i", surface.normals[face], direction) >= 0.0
    face = np.where(from_behind, -1, face)
    distance = np.where(face >= 0, distance, np.inf)
    shape = (len(X_OG), *yz.shape[:2])
    return face.reshape(shape), distance.reshape(shape)


def _weighted_mean(weight: Array, values: Array) -> Array:
    """(N, 2) means of values (..., 2, K) with weights (N, 2, K)."""
    return np.asarray(np.multiply(weight, values, order="C").sum(axis=-1))


def _rotate(X_OG: Array, p_G: Array) -> Array:
    """Rotates vectors (K, 3) or (N, K, 3) from G to O, (N, K, 3); independent of the batch."""
    R = X_OG[:, None, :3, :3]
    x, y, z = (p_G[..., k, None] for k in range(3))
    return np.asarray(R[..., 0] * x + R[..., 1] * y + R[..., 2] * z)


SLIDE_STEPS = 12
"""Number of steps in which the object slides by the shorter side of a pad."""


def slide_to_rest(
    surface: Surface, X_OG: Array, jaws: Jaws, friction: float, contacts: Contacts
) -> tuple[Contacts, Array]:
    """Lets objects slide until they need less friction than there is.

    Args:
        surface: surface of the object.
        X_OG: (N, 4, 4) grasps.
        jaws: the hand.
        friction: coefficient.
        contacts: contacts of the grasps before sliding.

    Returns:
        Contacts at rest, and sliding distances (N,) [m]: 0 if the pads hold at once; NaN unless
        both pads touch. If they do not hold within the shorter side of a pad, the distance is
        infinite, and the contacts are the given ones.
    """
    rest = {field.name: getattr(contacts, field.name).copy() for field in fields(Contacts)}
    moving = np.flatnonzero(contacts.touching & ~(friction_needed(contacts) < friction))
    slide = np.where(contacts.touching, 0.0, np.nan)
    slide[moving] = np.inf
    X, current = np.asarray(X_OG[moving], float).copy(), contacts.select(moving)
    step = min(np.ptp(jaws.y), np.ptp(jaws.z)) / SLIDE_STEPS
    for k in range(1, SLIDE_STEPS + 1):
        if not len(moving):
            break
        X[:, :3, 3] -= step * _slide_direction(current)
        current = grasp_contacts(surface, X, jaws)
        held = current.touching & (friction_needed(current) < friction)
        for name, values in rest.items():
            values[moving[held]] = getattr(current, name)[held]
        slide[moving[held]] = k * step
        sliding = current.touching & ~held
        moving, X, current = moving[sliding], X[sliding], current.select(sliding)
    return Contacts(**rest), slide


def _slide_direction(contacts: Contacts) -> Array:
    """(N, 3) unit vectors in O along which pads of equal force push the object; zero without a
    push."""
    line = contacts.p_OC[:, 1] - contacts.p_OC[:, 0]
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    towards = np.stack([line, -line], axis=1)
    along = (contacts.normal * towards).sum(axis=-1, keepdims=True)
    # Clipping the cosine between normal and closing line affects only the direction.
    push = contacts.normal / np.maximum(along, 0.1)  # by each pad, for a unit along the line
    across = (push - (push * towards).sum(axis=-1, keepdims=True) * towards).sum(axis=1)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(across / np.where(size > 0.0, size, 1.0))
