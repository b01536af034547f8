"""Process one frame of a live view: locate the camera, draw the overlay, check the placement.

Neither threads nor web pages: `live_session` runs this in a thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from burg_drake.cameras.frame_source import Frame
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.overlay import Overlay, OverlayStyle
from burg_drake.cameras.placement.document import PlacementCheck
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.cameras.pose.board_pose import BoardPose
from burg_drake.core import Array, Bytes, InvalidInputError, UnknownNameError, suggest_names
from burg_drake.scene import Board, Scene, SceneLike, as_scene

if TYPE_CHECKING:
    from burg_drake.cameras.pose_systems import PoseFilter, Track

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class ViewSettings:
    """Settings that a viewer can change while watching.

    Attributes:
        opacity: of the objects, 0 to 1; 0 leaves their outlines.
        names: write the objects' names.
        footprints: draw where objects touch the board.
        steady: draw at the mean of the last poses while the camera stands still, so that the
            overlay does not tremble; see `PoseFilter`.
        guide: name of the only instance to show, to place one object after the other; all if
            empty.
        frozen: keep looking at the same frame.
    """

    opacity: float = OverlayStyle.opacity
    names: bool = True
    footprints: bool = True
    steady: bool = False
    guide: str = ""
    frozen: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class LocatedFrame:
    """A frame with its camera's pose.

    Attributes:
        frame: frame of the source.
        estimate: estimate of the camera's pose, from this frame alone.
        X_SC: (4, 4) camera pose for drawing: the estimate's, or the mean of several; NaN without
            one.
        milliseconds: duration of each stage, by name.
    """

    frame: Frame
    estimate: BoardEstimate
    X_SC: Array
    milliseconds: dict[str, float] = field(default_factory=dict)


class FrameProcessor:
    """Processes frames of one camera over the board of one scene.

    Args:
        scene: scene to draw.
        intrinsics: intrinsics of the camera.
        print_scale: printed size of the board over its nominal size, along x and y.
        style: style of the overlay; the view's settings take precedence.

    Raises:
        UnknownNameError: a mesh file of the library is missing.
        InvalidInputError: the board's markers do not fit on it.
    """

    def __init__(
        self,
        scene: SceneLike,
        intrinsics: Intrinsics,
        *,
        print_scale: tuple[float, float] = (1.0, 1.0),
        style: OverlayStyle = OverlayStyle(),
    ) -> None:
        scene = as_scene(scene)
        scene.require_markers()
        self.scene, self.intrinsics, self.style = scene, intrinsics, style
        self._board_pose = BoardPose(scene.board, intrinsics, print_scale)
        self._overlay = Overlay(scene, intrinsics, style)
        self._filter: PoseFilter | None = None
        self._track: Track | None = None

    def locate(self, frame: Frame, *, steady: bool = False) -> LocatedFrame:
        """Estimates the pose of a frame's camera.

        Args:
            frame: frame to process.
            steady: filter poses of successive frames, see `ViewSettings`.

        Raises:
            InvalidInputError: the frame has another size than the intrinsics.
        """
        height, width = frame.image.shape[:2]
        self.intrinsics.require_size(width, height, frame.name)
        estimate, ms = time_call(lambda: self._board_pose.estimate(frame.image, depth=frame.depth))
        X_SC = estimate.X_SC
        if not steady:
            self._track = None
        elif estimate.valid:
            X_SC = self._filter_pose(estimate)
        return LocatedFrame(frame=frame, estimate=estimate, X_SC=X_SC, milliseconds={"pose": ms})

    def _filter_pose(self, estimate: BoardEstimate) -> Array:
        """The filtered pose after a new estimate."""
        from burg_drake.cameras.pose_systems import PoseFilter, Track

        if self._filter is None:
            # Each frame updates the filter, so that the period has no effect.
            self._filter = PoseFilter(period=1.0)
        self._track = self._filter.update(self._track or Track(), estimate)
        assert self._track.X_SC is not None
        return self._track.X_SC

    def draw(
        self, located: LocatedFrame, settings: ViewSettings, placement: PlacementCheck | None = None
    ) -> Bytes:
        """Draws the scene over the frame, or a line with the reason why not.

        Returns:
            (H, W, 3) RGB.
        """
        image, estimate = located.frame.image, located.estimate
        if not estimate.valid:
            return self._overlay.notice(image, describe_pose(estimate, self.scene.board))
        style = replace(
            self.style,
            opacity=settings.opacity,
            names=settings.names,
            footprints=settings.footprints,
            shown=(settings.guide,) if settings.guide else None,
        )
        return self._overlay.draw(image, located.X_SC, placement=placement, style=style)

    def check(self, located: LocatedFrame) -> PlacementCheck:
        """Checks the placement of the objects; takes a while."""
        from burg_drake.cameras.placement.check import check_placement

        depth = located.frame.depth
        return check_placement(
            self.scene,
            located.frame.image,
            self.intrinsics,
            depth=None if depth is None else depth.astype(np.float32),
            estimate=located.estimate,
            scale=self._board_pose.scale,
        )


def placement_order(scene: Scene) -> tuple[str, ...]:
    """Instances in the order for placing them by hand: fixed ones first, then from low to high,
    then from the far edge of the board to the near one, so that placed objects are not in the way.
    """

    def key(name: str) -> tuple[bool, int, float]:
        X_SO, entry = scene.X_SO(name), scene.entry(name)
        corners = np.stack(np.meshgrid(*zip(entry.lower, entry.upper, strict=True)), axis=-1)
        p_SQ = corners.reshape(-1, 3) @ X_SO[:3, :3].T + X_SO[:3, 3]
        middle = (p_SQ.min(axis=0) + p_SQ.max(axis=0)) / 2
        level = round(p_SQ[:, 2].min() / 0.01)  # undersides within 1 cm are on one level
        return name in scene.instances, level, -float(middle[1])  # False sorts first

    return tuple(sorted((*scene.background, *scene.instances), key=key))


def check_settings(scene: Scene, settings: ViewSettings) -> ViewSettings:
    """Checks settings and returns them unchanged.

    Raises:
        InvalidInputError: an opacity outside 0 to 1.
        UnknownNameError: `guide` is not an instance of the scene.
    """
    if not 0.0 <= settings.opacity <= 1.0:
        raise InvalidInputError(f"opacity {settings.opacity:g} is not a number from 0 to 1")
    known = (*scene.background, *scene.instances)
    if settings.guide and settings.guide not in known:
        raise UnknownNameError(
            f"scene {scene.name!r} has no instance {settings.guide!r};"
            f" {suggest_names(settings.guide, known)}"
        )
    return settings


def change_settings(scene: Scene, before: ViewSettings, changes: dict[str, Any]) -> ViewSettings:
    """Changes settings by name.

    Raises:
        InvalidInputError: a setting does not exist, or its value has the wrong type or is out of
            bounds.
        UnknownNameError: see `check_settings`.
    """
    max_number = 1e6  # Largest value of a setting.
    known = asdict(ViewSettings())
    for name, value in changes.items():
        if name not in known:
            raise InvalidInputError(
                f"setting {name!r} does not exist; {suggest_names(name, known)}"
            )
        wanted = type(known[name])
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (is_number if wanted is float else isinstance(value, wanted)):
            raise InvalidInputError(f"{name} must be a {wanted.__name__}, not {value!r}")
        if wanted is float and not abs(value) < max_number:  # integers may be too large for a float
            raise InvalidInputError(
                f"{name} is out of bounds; give a number between -{max_number:g} and {max_number:g}"
            )
    return check_settings(scene, replace(before, **changes))


def describe_pose(estimate: BoardEstimate, board: Board) -> str:
    """Describes the estimated pose of a camera in a line of text."""
    if not estimate.valid:
        return estimate.reason or "no pose"
    line = f"{len(estimate.ids)} of {len(board.layout.ids)} markers"
    sd = position_sd(estimate)
    if np.isfinite(sd):
        line += f", camera within {_format_two_digits(1e3 * sd)} mm"
    return line + (f"; {estimate.reason}" if estimate.reason else "")


def position_sd(estimate: BoardEstimate) -> float:
    """Standard deviation of the camera's position along the direction where it is largest [m];
    NaN without a pose."""
    variance = estimate.covariance[3:, 3:]  # of the translation; rotation comes first
    if not estimate.valid or not np.isfinite(variance).all():
        return float("nan")
    return float(np.sqrt(max(np.linalg.eigvalsh(variance)[-1], 0.0)))


def _format_two_digits(value: float) -> str:
    """Two significant digits, without exponent; 0.01 at least."""
    value = max(value, 0.01)
    return f"{value:.2f}" if value < 0.995 else f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def time_call(work: Callable[[], T]) -> tuple[T, float]:
    """Calls `work`; returns its result and its duration [ms]."""
    start = time.perf_counter()
    result = work()
    return result, 1e3 * (time.perf_counter() - start)
