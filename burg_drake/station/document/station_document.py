"""The station document: robot, table, board and cameras around a scene."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from burg_drake.core import FieldError, InvalidInputError, UnknownNameError, content_hash, nearest
from burg_drake.core.documents import (
    Pose,
    Ranges,
    Vector3,
    dump_document,
    load_document,
    plain_data,
    require_finite,
    require_ranges,
)
from burg_drake.core.paths import (
    NO_PACKAGES,
    Packages,
    named_files,
    named_packages,
    require_name,
    require_names,
    resolve,
)
from burg_drake.station.document.arm_control import ArmControl
from burg_drake.station.document.grasp_motion import GraspMotion
from burg_drake.station.document.gripper_document import Hand, locate_hand

MODEL_NAMES = ("table", "board", "hand", "arm", "lift")
"""What every station's own models are called; no instance of a scene may be called so."""

HALF_PIXEL = 0.5
"""From OpenCV's image coordinates, with pixel centres at integers, to those of Drake's cameras,
which have pixel edges there [pixels]."""
SLOWEST = 1e-3
"""Least limit of a joint [rad/s, rad/s^2, rad/s^3]; a motion with slower ones takes hours."""
MAX_SIDE = 16_384
"""Of a camera's image [pixels]."""
FOCAL_RANGE = (1.0, 1e6)
"""Of a camera [pixels]: a pixel sees less than half a turn, and more than nothing."""
MAX_SAMPLES = 8
"""Of a camera; 64 rays a pixel bring nothing more, and take seconds an image."""


def require_image_size(width: int, height: int) -> None:
    """Refuses a camera's image with a side above `MAX_SIDE`.

    Raises:
        FieldError: of the field `width` or `height`.
    """
    if max(width, height) > MAX_SIDE:
        raise FieldError(
            f"image of {width} x {height} pixels; a side may have at most {MAX_SIDE:,}",
            "width" if width > MAX_SIDE else "height",
        )


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm and its base.

    Attributes:
        model: model of the arm (URDF or SDF): `package://` address, or path relative to the
            station's file.
        base: link that is fixed in the world; its frame is A.
        flange: link or frame that carries the hand; its frame is F.
        X_FH: pose of the hand's body in the flange frame.
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
    flange: str = "panda_link8"
    X_FH: Pose = Pose(rpy_deg=(0.0, 0.0, -45.0))
    X_WA: Pose = Pose()
    home: tuple[float, ...]
    velocity: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None
    jerk: tuple[float, ...] | None = None
    stands_in: tuple[str, ...] = ()
    control: ArmControl = ArmControl()

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration", "jerk"):
            if min(getattr(self, name) or (1.0,)) < SLOWEST:
                raise FieldError(f"arm {name} limits must be {SLOWEST:g} or more", name)


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
        "width": (1, MAX_SIDE),
        "height": (1, MAX_SIDE),
        "focal": FOCAL_RANGE,
        "samples": (1, MAX_SAMPLES),
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
                    f"{nearest(name, known)}",
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
    """A station with its hand at hand.

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
        packages: where packages that models name are looked for.
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
                f" {nearest(name, known)}"
            )
        return known[name]

    @cached_property
    def content(self) -> str:
        """Hash of the station, its hand document and the robot's model files with their meshes;
        names, file locations and the usual motion do not count, as who asks says how the hand shall
        move."""
        arm = self.document.arm and replace(self.document.arm, model="")
        placed = plain_data(replace(self.document, description="", hand="", arm=arm))
        for name in ("motion", "packages"):
            placed.pop(name, None)
        models = [self.hand_model, *([self.arm_model] if self.arm_model else [])]
        files = [file for model in models for file in (model, *named_files(model, self.packages))]
        return content_hash(dump_document(placed | {"name": ""}), dump_document(self.hand), files)


def load_station(reference: str | Path) -> Station:
    """Loads a station and its hand.

    Example::

        station = burg.load_station("panda_tabletop")  # built in; or a path
        print(station.hand.opening, list(station.document.cameras))

    Args:
        reference: path of a station file, or the bare name of a built-in station.

    Raises:
        UnknownNameError: no such station, hand or model, or no such package; the message tells
            where it was looked for.
        DocumentError: the file does not fit the schema.
    """
    path = resolve(reference, "stations")
    document = load_document(path, StationDocument)
    packages = Packages(_stated(document, path), path)
    with _named(path, "hand"):
        hand, hand_model, hand_path = locate_hand(document.hand, path.parent, packages)
    arm_model = None
    if document.arm is not None:
        with _named(path, "arm.model"):
            arm_model = resolve(document.arm.model, base=path.parent, packages=packages)
            named_packages(arm_model, packages)
    return Station(document, hand, hand_model, arm_model, path, hand_path, packages)


StationLike = Station | str | Path
"""A station, loaded or by what `load_station` takes: a path, or the name of a built-in one."""


def as_station(station: StationLike) -> Station:
    """A station, loaded if it is given by name.

    Raises:
        UnknownNameError, DocumentError: see `load_station`.
    """
    return station if isinstance(station, Station) else load_station(station)


def _stated(document: StationDocument, path: Path) -> dict[str, Path]:
    """The folders that a station states, by the names of packages."""
    found = {}
    for name, reference in document.packages.items():
        with _named(path, f"packages.{name}"):
            found[name] = resolve(reference, base=path.parent)
        if not found[name].is_dir():
            raise InvalidInputError(
                f"{path}: packages.{name}: {reference} is not a folder; give the folder"
                f" to which package://{name}/... is relative"
            )
    return found


@contextlib.contextmanager
def _named(path: Path, key: str) -> Iterator[None]:
    """Says which key of the station names something that is not there."""
    try:
        yield
    except UnknownNameError as error:
        raise UnknownNameError(f"{path}: {key}: {error}") from error
