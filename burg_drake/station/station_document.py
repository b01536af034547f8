"""The station document: robot, table, board, cameras and obstacles around a scene.

Also computes values that need only the document: the part of the board that cameras see, and the
corners of the obstacles.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    NO_PACKAGES,
    Array,
    FieldError,
    InvalidInputError,
    Packages,
    Pose,
    Ranges,
    UnknownNameError,
    Vector3,
    content_hash,
    dump_document,
    inverse,
    load_document,
    plain_data,
    referenced_files,
    referenced_packages,
    require_finite,
    require_name,
    require_names,
    require_ranges,
    resolve_reference,
    suggest_names,
    transform_points,
)
from burg_drake.scene import Board
from burg_drake.station.grasp_motion import GraspMotion
from burg_drake.station.hand_document import Hand, locate_hand

DEFAULT_JOINT_STIFFNESS = np.array([3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0])
"""Nm/rad, of libfranka's examples for a Panda (`setJointImpedance`)."""
DEFAULT_ACCELERATION_GAIN = 2000.0
"""1/s^2, the stiffest that Drake gives a simulated iiwa; its others go down to 500."""


@dataclass(frozen=True, kw_only=True)
class ArmControl:
    """How the joints of an arm follow their commands in simulation.

    With `impedance` every joint has its own spring and damper, which Drake's solver computes as
    part of a step. Gravity does not pull the robot then: a real one compensates its own weight.
    With `inverse_dynamics` gravity does pull it, and the torque follows from a model of arm and
    hand for the acceleration `kp` (q_d - q) + `kd` (v_d - v). That model does not include held
    objects. Either way torques are limited to the effort limits.

    Attributes:
        kind: `impedance`: a spring and a damper for each joint; gravity does not pull the robot.
            `inverse_dynamics`: torques from a model of arm and hand, which knows nothing of what
            the hand holds.
        kp: position gains, one for all joints or one for each: [Nm/rad] with `impedance`, [1/s^2]
            with `inverse_dynamics`.
        kd: velocity gains, one for all joints or one for each: [Nm s/rad] with `impedance`, [1/s]
            with `inverse_dynamics`. If left out, `kp` times 0.05 s with `impedance`, critical
            damping with `inverse_dynamics`.
    """

    kind: Literal["impedance", "inverse_dynamics"] = "impedance"
    kp: tuple[float, ...] | None = None
    kd: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        gain_range = (1e-3, 1e6)  # Stiffer than any drive.
        for name in ("kp", "kd"):
            values = getattr(self, name)
            low, high = gain_range
            if values is not None and not (values and low <= min(values) <= max(values) <= high):
                raise FieldError(
                    f"{name} {list(values)} must be one number, or one for each joint,"
                    f" from {low:g} to {high:g}",
                    name,
                )

    def gains(self, joints: int, where: str) -> tuple[Array, Array]:
        """`kp` and `kd`, (n,) each, of an arm with n joints.

        Args:
            joints: number of joints.
            where: the document's key, for messages.

        Raises:
            InvalidInputError: the document has neither one nor n numbers.
        """
        damping_time = 0.05  # Seconds: velocity gain over position gain.
        kp = _joint_values(self.kp, joints, f"{where}.kp")
        kd = _joint_values(self.kd, joints, f"{where}.kd")
        if self.kind == "impedance":
            kp = np.resize(DEFAULT_JOINT_STIFFNESS, joints) if kp is None else kp
            return kp, damping_time * kp if kd is None else kd
        kp = np.full(joints, DEFAULT_ACCELERATION_GAIN) if kp is None else kp
        return kp, 2.0 * np.sqrt(kp) if kd is None else kd


def _joint_values(values: tuple[float, ...] | None, joints: int, where: str) -> Array | None:
    if values is None:
        return None
    if len(values) not in (1, joints):
        raise InvalidInputError(
            f"{where} has {len(values)} numbers; give one, or one for each of the {joints} joints"
        )
    return np.resize(np.array(values), joints)


MODEL_NAMES = ("table", "board", "hand", "arm", "lift")
"""Names of a station's own models, which instances of a scene must not have."""

HALF_PIXEL = 0.5
"""Pixels from OpenCV's image coordinates to those of Drake's cameras."""
MAX_IMAGE_SIDE = 16_384
"""Pixels, side of a camera's image."""
FOCAL_RANGE = (1.0, 1e6)
"""Pixels, focal lengths of a camera."""


def require_image_size(width: int, height: int) -> None:
    """Rejects a camera's image with a side above `MAX_IMAGE_SIDE`.

    Raises:
        FieldError: the field `width` or `height` is too large.
    """
    if max(width, height) > MAX_IMAGE_SIDE:
        raise FieldError(
            f"image of {width} x {height} pixels; a side may have at most {MAX_IMAGE_SIDE:,}",
            "width" if width > MAX_IMAGE_SIDE else "height",
        )


@dataclass(frozen=True)
class _PandaMount(Pose):
    """How Franka's hand sits on `panda_link8`. It differs from the same pose given by a user, so
    that the mount of another flange is written to files."""

    rpy_deg: Vector3 | None = (0.0, 0.0, -45.0)


PANDA_FLANGE = "panda_link8"
"""Flange of a Panda, the only one for which `Arm.X_FH` may be left out."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm and its base.

    Attributes:
        model: model of the arm (URDF or SDF): `package://` address, or path relative to the
            station's file.
        base: link that is fixed in the world; its frame is A.
        flange: link or frame that carries the hand; its frame is F.
        X_FH: pose of the hand's body in the flange frame. May be left out only for a Panda's
            `panda_link8`, on which the hand is turned by -45 degrees.
        X_WA: pose of the arm's base in the world.
        home: joint positions of the home posture [rad].
        velocity: velocity limit of each joint [rad/s], in place of the model's.
        acceleration: acceleration limit of each joint [rad/s^2], in place of the usual one.
        jerk: jerk limit of each joint [rad/s^3], in place of the usual one.
        stands_in: names of boxes, or `table`, that the arm's base may overlap, such as a table with
            the base let into it. Moving links still collide with them.
        control: how the joints follow their commands in simulation.
    """

    model: str = "package://burg_drake/models/panda/panda_arm.sdf"
    base: str = "panda_link0"
    flange: str = PANDA_FLANGE
    X_FH: Pose = _PandaMount()
    X_WA: Pose = Pose()
    home: tuple[float, ...]
    velocity: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None
    jerk: tuple[float, ...] | None = None
    stands_in: tuple[str, ...] = ()
    control: ArmControl = ArmControl()

    def __post_init__(self) -> None:
        min_limit = 1e-3  # rad/s, rad/s^2, rad/s^3; slower motions take hours.
        for name in ("velocity", "acceleration", "jerk"):
            if min(getattr(self, name) or (1.0,)) < min_limit:
                raise FieldError(f"arm {name} limits must be {min_limit:g} or more", name)
        if isinstance(self.X_FH, _PandaMount) and self.flange != PANDA_FLANGE:
            raise FieldError(
                f"X_FH is missing, and only a Panda's {PANDA_FLANGE!r} has a usual one; give the"
                f" pose of the hand's body in the frame of {self.flange!r}: X_FH: {{}} if the two"
                " frames coincide, X_FH: {rpy_deg: [0, 0, 45]} for a hand turned by 45 degrees",
                "flange",
            )


@dataclass(frozen=True, kw_only=True)
class Table:
    """The table: a box whose top face is at z = 0 of the world.

    Attributes:
        center: x and y of the box's centre in the world [m].
        size: lengths along x, y and z [m].
        friction: friction coefficient of its surface.
    """

    center: tuple[float, float] = (0.0, 0.0)
    size: Vector3 = (1.2, 1.6, 0.1)
    friction: float = 0.5

    def __post_init__(self) -> None:
        if min(self.size) <= 0.0 or self.friction < 0.0:
            raise InvalidInputError("table size must be positive and friction at least 0")


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A camera fixed in the world, with pinhole intrinsics.

    As in OpenCV, pixel centres are at integers.

    Attributes:
        X_WC: pose of the optical frame in the world: z forward, x right, y down.
        width: width of the image [pixels].
        height: height of the image [pixels].
        focal: focal lengths fx and fy [pixels].
        center: principal point cx and cy [pixels]; the middle of the image if left out.
        depth_range: smallest and largest depth that it measures [m].
        samples: rays per pixel along x and along y in simulated colour images; more of them make
            smoother edges.
    """

    RANGES: ClassVar[Ranges] = {
        "width": (1, MAX_IMAGE_SIDE),
        "height": (1, MAX_IMAGE_SIDE),
        "focal": FOCAL_RANGE,
        "samples": (1, 8),
    }

    X_WC: Pose
    width: int = 640
    height: int = 480
    focal: tuple[float, float] = (600.0, 600.0)
    center: tuple[float, float] | None = None
    depth_range: tuple[float, float] = (0.05, 5.0)
    samples: int = 1

    def __post_init__(self) -> None:
        require_ranges(self, "a camera")
        if not 0.0 < self.depth_range[0] < self.depth_range[1]:
            raise InvalidInputError(
                "camera depth_range must be two distances above 0 in metres, the smaller one first"
            )

    @property
    def principal_point(self) -> tuple[float, float]:
        """cx, cy [pixels]."""
        return self.center or ((self.width - 1) / 2, (self.height - 1) / 2)


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """A fixed box.

    Attributes:
        X_WB: pose of the box's centre in the world.
        size: lengths along x, y and z [m].
    """

    X_WB: Pose
    size: Vector3

    def __post_init__(self) -> None:
        if min(self.size) <= 0.0:
            raise InvalidInputError(f"obstacle size {list(self.size)} must be positive [m]")


@dataclass(frozen=True, kw_only=True)
class StationDocument:
    """A station: hand, arm, table, cameras and obstacles around a board.

    Attributes:
        name: name of the station. Letters, digits, `_`, `-` and `.`.
        description: text for people.
        hand: hand: name of a built-in one, or its file, relative to this file.
        arm: the arm. Without one the hand moves freely.
        X_WS: pose of the scene frame in the world: where the board lies.
        table: the table under the board.
        cameras: fixed cameras by name.
        background: fixed boxes by name.
        motion: how the hand approaches a grasp and lifts, unless the command says otherwise.
        packages: folders of ROS packages by name, for `package://NAME/...` in models. Only packages
            that are not found otherwise need an entry.
    """

    version: int = 1
    name: str
    description: str = ""
    hand: str = "panda_hand"
    arm: Arm | None = None
    X_WS: Pose = Pose()
    table: Table = Table()
    cameras: dict[str, Camera] = field(default_factory=dict)
    background: dict[str, Obstacle] = field(default_factory=dict)
    motion: GraspMotion = field(default_factory=GraspMotion)
    packages: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_finite(self)
        require_name(self.name, "name")
        require_names(self.cameras, "cameras")
        require_names(self.background, "background")
        if self.arm is None:
            return
        known = ("table", *self.background)
        for i, name in enumerate(self.arm.stands_in):
            if name not in known:
                raise FieldError(
                    f"{name!r} is neither the table nor an entry of background; "
                    f"{suggest_names(name, known)}",
                    *("arm", "stands_in", i),
                )
        x, y, z = self.arm.X_WA.translation
        (cx, cy), (sx, sy, _) = self.table.center, self.table.size
        over_table = abs(x - cx) < sx / 2 and abs(y - cy) < sy / 2
        if z < 0.0 and over_table and "table" not in self.arm.stands_in:
            raise FieldError(
                f"arm.X_WA puts the base of the arm {-1e3 * z:.0f} mm deep into 'table';"
                f" raise it (translation: [{x:g}, {y:g}, 0]) or move it off the table. If"
                " the base is really sunk into the table, write arm.stands_in: [table]",
                *("arm", "X_WA"),
            )


@dataclass(frozen=True, eq=False)
class Station:
    """A station with its hand document and the robot's model files.

    Example::

        station = burg.load_station("panda_tabletop")
        print(station.document.cameras, station.hand)

    Attributes:
        document: contents of the station file.
        hand: the hand that `document.hand` names.
        hand_model: the hand's model file.
        arm_model: the arm's model file, if there is an arm.
        path: the station file.
        hand_path: the hand's document, for messages; None if it is not from a file.
        packages: folders of the packages that models name.
    """

    document: StationDocument
    hand: Hand
    hand_model: Path
    arm_model: Path | None
    path: Path
    hand_path: Path | None = None
    packages: Packages = NO_PACKAGES

    def __repr__(self) -> str:
        arm = f", arm {self.arm_model.stem!r}" if self.arm_model else ""
        return f"Station({self.name!r}, hand {self.hand.name!r}{arm}, {str(self.path)!r})"

    @property
    def name(self) -> str:
        """The station's name."""
        return self.document.name

    def camera(self, name: str) -> Camera:
        """A camera of the station.

        Raises:
            UnknownNameError: there is no such camera.
        """
        known = self.document.cameras
        if name not in known:
            raise UnknownNameError(
                f"station {self.name!r} ({self.path}) has no camera {name!r};"
                f" {suggest_names(name, known)}"
            )
        return known[name]

    @cached_property
    def content(self) -> str:
        """Hash of the station, its hand document and the robot's model files with their meshes.
        Names and file locations are left out, and the default motion, which callers hash
        themselves."""
        arm = self.document.arm and replace(self.document.arm, model="")
        placed = plain_data(replace(self.document, description="", hand="", arm=arm))
        for name in ("motion", "packages"):
            placed.pop(name, None)
        models = [self.hand_model, *([self.arm_model] if self.arm_model else [])]
        files = [
            file for model in models for file in (model, *referenced_files(model, self.packages))
        ]
        return content_hash(dump_document(placed | {"name": ""}), dump_document(self.hand), files)


def load_station(reference: str | Path) -> Station:
    """Loads a station and its hand.

    Example::

        station = burg.load_station("panda_tabletop")  # built in; or a path
        print(station.hand.opening, list(station.document.cameras))

    Args:
        reference: path of a station file, or the bare name of a built-in station.

    Raises:
        UnknownNameError: no such station, hand, model or package; the message lists the searched
            places.
        DocumentError: the file does not fit the schema.
    """
    path = resolve_reference(reference, "stations")
    document = load_document(path, StationDocument)
    packages = Packages(_stated_packages(document, path), path)
    with _name_station_key(path, "hand"):
        hand, hand_model, hand_path = locate_hand(document.hand, path.parent, packages)
    arm_model = None
    if document.arm is not None:
        with _name_station_key(path, "arm.model"):
            arm_model = resolve_reference(document.arm.model, base=path.parent, packages=packages)
            referenced_packages(arm_model, packages)
    return Station(document, hand, hand_model, arm_model, path, hand_path, packages)


StationLike = Station | str | Path
"""A loaded station, or an argument of `load_station`: a path, or the name of a built-in one."""


def as_station(station: StationLike) -> Station:
    """A station, loaded if it is given by name.

    Raises:
        UnknownNameError, DocumentError: see `load_station`.
    """
    return station if isinstance(station, Station) else load_station(station)


def _stated_packages(document: StationDocument, path: Path) -> dict[str, Path]:
    """Folders of the packages in a station document, by name."""
    found = {}
    for name, reference in document.packages.items():
        with _name_station_key(path, f"packages.{name}"):
            found[name] = resolve_reference(reference, base=path.parent)
        if not found[name].is_dir():
            raise InvalidInputError(
                f"{path}: packages.{name}: {reference} is not a folder; give the folder"
                f" to which package://{name}/... is relative"
            )
    return found


@contextlib.contextmanager
def _name_station_key(path: Path, key: str) -> Iterator[None]:
    """Adds the station's key to errors about unknown names."""
    try:
        yield
    except UnknownNameError as error:
        raise UnknownNameError(f"{path}: {key}: {error}") from error


def obstacle_corners(station: Station) -> list[Array]:
    """Corners (8, 3) of each of a station's fixed boxes, in the scene frame [m]."""
    # Corners of a unit box.
    unit_corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    X_SW = inverse(station.document.X_WS.matrix())
    return [
        transform_points(X_SW @ box.X_WB.matrix(), unit_corners * box.size)
        for box in station.document.background.values()
    ]


def visible_board_share(camera: Camera, station: Station, board: Board) -> float:
    """Share of the board that a camera sees past the station's obstacles, without robot and
    objects."""
    p_WQ = board_points(station, board)
    seen = are_points_in_view(camera, p_WQ)
    p_WC = np.array(camera.X_WC.translation)
    for box in station.document.background.values():
        seen &= ~lines_through_box(box, p_WC, p_WQ)
    return float(seen.mean())


def board_points(station: Station, board: Board) -> Array:
    """Points (N, 3) on a grid over the board, including edges, in the world [m]."""
    point_count = 61  # Points along each side of the board.
    x, y = (np.linspace(0.0, extent, point_count) for extent in board.size)
    p_SQ = np.stack([*np.meshgrid(x, y), np.zeros((point_count, point_count))], axis=-1).reshape(
        -1, 3
    )
    return transform_points(station.document.X_WS.matrix(), p_SQ)


def are_points_in_view(camera: Camera, p_WQ: Array) -> NDArray[np.bool_]:
    """Whether points (N, 3) are in a camera's image and depth range (N,)."""
    p_CQ = transform_points(inverse(camera.X_WC.matrix()), p_WQ)
    near, far = camera.depth_range
    depth = p_CQ[:, 2]
    ahead = (near <= depth) & (depth <= far)
    pixel = p_CQ[:, :2] / np.where(ahead, depth, 1.0)[:, None] * camera.focal
    pixel += camera.principal_point
    size = np.array([camera.width, camera.height])
    inside = (pixel >= -0.5) & (pixel <= size - 0.5)  # pixel centres are at integers
    return np.asarray(ahead & inside.all(axis=1))


def lines_through_box(box: Obstacle, p_WA: Array, p_WQ: Array) -> NDArray[np.bool_]:
    """Whether the line segments from a point A (3,) to points (N, 3) pass through a box (N,), by
    the slab method (Kay and Kajiya, SIGGRAPH 1986)."""
    end_share = 1e-6  # Share of the ray at its end in which obstacles are ignored.
    X_BW = inverse(box.X_WB.matrix())
    p_BA = transform_points(X_BW, p_WA[None])[0]
    ray = transform_points(X_BW, p_WQ) - p_BA
    half = np.array(box.size) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-half - p_BA) / ray, (half - p_BA) / ray])
    # A line parallel to two faces never crosses them: it is always or never between them.
    level = ray == 0.0
    ends = np.where(level, np.where(np.abs(p_BA) < half, [[[-np.inf]], [[np.inf]]], np.inf), ends)
    enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return np.asarray((enter < leave) & (leave > 0.0) & (enter < 1.0 - end_share))


def frustum(camera: Camera, depth: float) -> Array:
    """Corners (4, 3) of a camera's image at a depth [m], in the world, around the image from the
    upper left."""
    w, h = camera.width - 0.5, camera.height - 0.5
    corners = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
    rays = (corners - camera.principal_point) / camera.focal
    p_CQ = depth * np.column_stack([rays, np.ones(4)])
    return transform_points(camera.X_WC.matrix(), p_CQ)
