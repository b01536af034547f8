"""Analytic quality of grasps: loads that two compliant pads with Coulomb friction withstand.

`force_closure`, `friction_needed` and `antipodal_angle` are for the grasp as given, all other
metrics for the object at rest in the hand after sliding. The hand's body, the table and other
objects are left out.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    canonical_fingers,
    suggest_names,
)
from burg_drake.geometry import Surface
from burg_drake.grasping.pad_contacts import (
    PANDA_JAWS,
    Contacts,
    Jaws,
    antipodal_angle,
    friction_needed,
    grasp_contacts,
    slide_to_rest,
)
from burg_drake.grasping.wrench_margins import ANY_FORCE, ANY_WRENCH, force_along, wrench_reaches
from burg_drake.grasping.wrench_space import WrenchSpace, hull_volume, triangulated_ball
from burg_drake.objects import ObjectEntry

QUALITY_VERSION = 3
"""Raised when the same grasps get other metrics."""

STANDARD_GRAVITY = 9.81
"""m/s^2, as in Drake."""

DEFAULT_METRIC = "load_margin"
"""It depends on the weight, the grip force, the lever of the centre of mass and the size of the
patches, and has a natural scale: at 1 the grip just bears the object. Epsilon depends on an
arbitrary length, and the angles do not depend on the weight.

Probability that a lifted grasp ranks above a failed one, with 95 % intervals, in 1,500 trials on
the six objects of `tabletop_six` at four times their mass, 933 lifted (`benchmarks/ranking.py`):
0.951 (0.939 to 0.962); contact_offset 0.945 (0.932 to 0.955), gravity_margin 0.674 (0.652 to
0.695), epsilon 0.610 (0.588 to 0.632). For grasps on the same object 0.898 (0.871 to 0.924),
gravity_margin 0.912 (0.885 to 0.936). At the objects' own mass, 1,437 lifted: 0.917 (0.885 to
0.948); on the same object 0.781 (0.720 to 0.848), gravity_margin 0.865 (0.826 to 0.902)."""


@dataclass(frozen=True, kw_only=True)
class Payload:
    """Mass and friction of the held object.

    Attributes:
        mass: [kg].
        center_of_mass: centre of mass in the object frame O [m].
        friction: coefficient between object and pads.
    """

    mass: float
    center_of_mass: tuple[float, float, float]
    friction: float

    def __post_init__(self) -> None:
        if not 0.0 < self.mass < np.inf:
            raise InvalidInputError(f"mass is {self.mass:g} kg; give more than 0")
        if not np.isfinite(self.center_of_mass).all():
            raise InvalidInputError(f"center_of_mass is {self.center_of_mass}; give metres")
        if not 0.0 <= self.friction < np.inf:
            raise InvalidInputError(
                f"friction is {self.friction:g}; give a coefficient of 0 or more"
            )

    @classmethod
    def of(cls, entry: ObjectEntry, friction: float | None = None) -> Payload:
        """Payload of a library entry; the object's own friction coefficient if None."""
        properties = entry.mass_properties
        return cls(
            mass=properties.mass,
            center_of_mass=properties.center_of_mass,
            friction=entry.friction if friction is None else friction,
        )


@dataclass(frozen=True, eq=False)
class Quality:
    """Metrics of N grasps; NaN (and no force closure) unless both pads touch.

    Attributes:
        force_closure: whether the line between the contacts lies strictly within both friction
            cones (Nguyen, "Constructing force-closure grasps", IJRR 1988), that is, whether less
            friction is needed than there is; torsional friction of the patches then resists
            rotation about that line. If false, the object slides, and may be held elsewhere.
        friction_needed: tangent of the larger angle between that line and the inward normals.
            Infinite from 90 degrees.
        antipodal_angle: larger of the angles between the closing direction of the grasp, before the
            object turns, and the inward normals [rad].
        slide: sliding distance of the object in the hand until it is in force closure [m]: 0 if it
            is at once, infinite if it never is, see `slide_to_rest`.
        epsilon: radius of the largest ball about the origin within the wrench space [-] (Ferrari
            and Canny, ICRA 1992): soft-finger contacts, normal forces that add up to one, torques
            about the centre of mass over its largest distance from the surface. 0 if the pads never
            hold the object. Found by a search whose result is never too small; see
            `wrench_margins`.
        volume: volume of the wrench space [-] (Miller and Allen, "Examples of 3D grasp quality
            computations", ICRA 1999); 0 if the pads never hold the object. Coarser than epsilon:
            the friction ellipsoid is approximated by a polytope of equal volume with 80 faces.
        load_margin: largest force on the centre of mass that the grip bears in every direction,
            over the object's weight, with Coulomb friction and torsion of the patches. The pad
            forces add up to twice the hand's, as those of coupled fingers do. 0 without force
            closure.
        gravity_margin: the same along gravity; NaN if the pose is not known. Below 1 the object
            begins to turn in the hand, but need not drop: most objects swing until their centre of
            mass hangs below the pads. Of 1,000 trials on the objects of `tabletop_six` and two
            scans, 332 had a margin below 1: 282 were lifted, 149 of them turned by more than 5
            degrees. Of 451 with 1.5 or more, 436 were lifted, 24 turned.
        patch_area: area of the smaller of the two patches [m^2].
        contact_offset: distance between centre of mass and the line through the contacts [m].
    """

    force_closure: NDArray[np.bool_]
    friction_needed: Array
    antipodal_angle: Array
    slide: Array
    epsilon: Array
    volume: Array
    load_margin: Array
    gravity_margin: Array
    patch_area: Array
    contact_offset: Array


METRICS = tuple(field.name for field in fields(Quality))
"""Names of the columns of metrics."""


def quality_provenance(jaws: Jaws, by: str, **details: Any) -> dict[str, Any]:
    """Parameters with which the metrics of a set were computed, as JSON values."""
    how = {"version": QUALITY_VERSION, "by": by, "jaws": asdict(jaws), **details}
    plain: dict[str, Any] = json.loads(json.dumps(how))
    return plain


def check_metric(name: str) -> None:
    """Refuses unknown names of metrics.

    Raises:
        UnknownNameError: there is no such metric.
    """
    if name not in METRICS:
        raise UnknownNameError(f"there is no metric {name!r}; {suggest_names(name, METRICS)}")


def score_of(values: NDArray[Any], metric: str) -> Array:
    """Scores (N,) of the values of a metric: higher is better."""
    lower_is_better = ("friction_needed", "antipodal_angle", "slide", "contact_offset")
    scores = np.asarray(values, float)
    return -scores if metric in lower_is_better else scores


def grasp_quality(
    X_OG: Array,
    surface: Surface,
    payload: Payload,
    jaws: Jaws = PANDA_JAWS,
    *,
    up: ArrayLike | None = None,
) -> Quality:
    """Computes all metrics of grasps.

    A grasp and the one with swapped fingers get the same metrics, bit by bit.

    Args:
        X_OG: (N, 4, 4) grasps of one object.
        surface: surface of the object.
        payload: mass, centre of mass and friction of the object.
        jaws: jaws of the hand.
        up: (3,) or (N, 3) direction against gravity in the object frame; None if unknown.

    Raises:
        InvalidInputError: `up` has a wrong shape, or is zero or not finite.
    """
    X_OG = canonical_fingers(X_OG)
    up_O = None if up is None else _unit_directions(up, len(X_OG))
    given = grasp_contacts(surface, X_OG, jaws)
    com, mu = np.array(payload.center_of_mass), payload.friction
    contacts, slide = slide_to_rest(surface, X_OG, jaws, mu, given)
    held = np.isfinite(slide)
    length = float(np.linalg.norm(surface.triangles.reshape(-1, 3) - com, axis=1).max())
    space = WrenchSpace.of(contacts.select(held), mu, com, length, X_OG[held, :3, 1])
    goals = [ANY_WRENCH, ANY_FORCE, *([] if up_O is None else [force_along(up_O[held])])]
    reach = wrench_reaches(space, goals)
    weights = 2.0 * jaws.force / (payload.mass * STANDARD_GRAVITY)
    unknown = np.full(len(X_OG), np.nan)

    def spread(values: Array) -> Array:
        column = np.where(contacts.touching, 0.0, np.nan)
        column[held] = values
        return column

    return Quality(
        force_closure=slide == 0.0,
        friction_needed=friction_needed(given),
        antipodal_angle=antipodal_angle(given, X_OG),
        slide=slide,
        epsilon=spread(reach[0]),
        volume=spread(hull_volume(space, triangulated_ball(1, of_volume=True))),
        load_margin=spread(weights * reach[1]),
        gravity_margin=unknown if up_O is None else spread(weights * reach[2]),
        patch_area=contacts.area.min(axis=1),
        contact_offset=_distance_from_line(contacts, com),
    )


def _distance_from_line(contacts: Contacts, p_OQ: Array) -> Array:
    """(N,) distance of a point from the lines through both contacts [m]."""
    p1, p2 = contacts.p_OC[:, 0], contacts.p_OC[:, 1]
    return np.asarray(
        np.linalg.norm(np.cross(p2 - p1, p_OQ - p1), axis=1) / np.linalg.norm(p2 - p1, axis=1)
    )


def _unit_directions(up: ArrayLike, n: int) -> Array:
    """Normalizes directions (3,) or (n, 3) to unit vectors (n, 3)."""
    given = np.asarray(up, float)
    if given.shape not in ((3,), (n, 3)):
        raise InvalidInputError(f"up has shape {given.shape}; expected (3,) or ({n}, 3)")
    length = np.linalg.norm(given, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0.0)).all():
        raise InvalidInputError("up must be finite directions that are not zero")
    return np.broadcast_to(given / length, (n, 3))
