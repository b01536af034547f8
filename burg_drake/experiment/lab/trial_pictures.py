"""Pictures of trials: each grasp on its scene, and the set-up of each block.

One painter makes all pictures; it belongs to the thread that created it. Pictures depend on the
grasps alone, so they are reproducible. The edge of the board nearest to the operator is y = 0; a
camera looks from the side if the view from the front is blocked.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from burg_drake.cameras import Intrinsics, draw_tags, render_tag
from burg_drake.core import Array, BurgError, Bytes, inverse, make_pose, transform_points
from burg_drake.experiment.lab.painters import (
    GROUND_BODY,
    HAND_BODY,
    Painter,
    Painting,
    PlacedBody,
    RayPainter,
    SceneBodies,
    Viewpoint,
    VtkPainter,
    count_bodies,
)
from burg_drake.experiment.lab.tried_grasps import TriedRuns, trials_by_block
from burg_drake.experiment.trials.trial_sheet import RealTrial
from burg_drake.geometry import RayCaster
from burg_drake.system_libraries import missing_render_libraries
from burg_drake.visualization import camera_rotation_along, fit_camera, painted_shadow

PICTURE_HALF_VIEW = 0.24  # Tangent of half the vertical angle of view.


@dataclass(frozen=True, eq=False)
class ViewedGrasp:
    """A grasp to be shown, in S [m].

    Attributes:
        X_SG: (4, 4) the grasp.
        width: distance between the pads.
        target: (N, 3) points on the target's surface.
        hand: (N, 3) points around the hand.
    """

    X_SG: Array
    width: float
    target: Array
    hand: Array


def pinhole(size: tuple[int, int], half_view: float) -> Intrinsics:
    """Pinhole intrinsics from image size and the tangent of half the vertical angle of view."""
    width, height = size
    focal = height / 2.0 / half_view
    center = ((width - 1) / 2.0, (height - 1) / 2.0)
    return Intrinsics(width=width, height=height, focal=(focal, focal), center=center)


def camera_direction(azimuth: float, elevation: float) -> Array:
    """(3,) viewing direction of a camera in S."""
    level = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.cos(elevation) * level - np.array([0.0, 0.0, np.sin(elevation)])


def grasp_viewpoint(
    subject: ViewedGrasp, scene: RayCaster, hand: RayCaster, X_HS: Array, size: tuple[int, int]
) -> Viewpoint:
    """The viewpoint that shows most of a grasp.

    Args:
        subject: the grasp.
        scene: ray caster of the objects, in S.
        hand: ray caster of the hand, in its own frame H.
        X_HS: (4, 4) S in H.
        size: width and height of the picture [pixel].
    """
    # Radians from the front of the board, positive to the right.
    azimuths = np.deg2rad(np.array([0.0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180]))
    elevations = np.deg2rad(np.array([28.0, 48.0]))  # Downward angles of the cameras [rad].
    candidates = [(a, e) for e in elevations for a in azimuths]
    chosen = max(candidates, key=lambda c: _viewpoint_score(subject, scene, hand, X_HS, *c))
    return fit_viewpoint(np.vstack([subject.target, subject.hand]), camera_direction(*chosen), size)


def fit_viewpoint(points: Array, forward: Array, size: tuple[int, int]) -> Viewpoint:
    """The nearest viewpoint that looks in a direction and has all points (N, 3) in view."""
    return _nearest_viewpoint(points, camera_rotation_along(forward), size, PICTURE_HALF_VIEW)


def viewpoint_from_above(points: Array, size: tuple[int, int]) -> Viewpoint:
    """Viewpoint from straight above; the board's far edge is at the top of the picture."""
    half_view = 0.06  # Tangent of half the vertical angle: hardly any perspective.
    return _nearest_viewpoint(points, np.diag([1.0, -1.0, -1.0]), size, half_view)


def _nearest_viewpoint(
    points: Array, R_SC: Array, size: tuple[int, int], half_view: float
) -> Viewpoint:
    filled_share = 0.86  # Share of the picture that the points fill.
    half = filled_share * half_view * np.array([size[0] / size[1], 1.0])
    return Viewpoint(make_pose(R_SC, fit_camera(points, R_SC, half)), pinhole(size, half_view))


def _viewpoint_score(
    subject: ViewedGrasp,
    scene: RayCaster,
    hand: RayCaster,
    X_HS: Array,
    azimuth: float,
    elevation: float,
) -> float:
    finger_weight = 0.7  # Weight of visible fingers, relative to the visible target.
    side_by_side_weight = 0.5  # Weight of a view across the closing direction.
    front_weight = 0.25  # Weight of a view from the front of the board.
    samples = 80  # Number of tested points of the target.
    forward = camera_direction(azimuth, elevation)
    step = max(1, len(subject.target) // samples)
    target, fingers = subject.target[::step], _finger_points(subject)
    seen = _are_unobstructed(scene, target, -forward)
    in_hand = transform_points(X_HS, target)
    seen &= _are_unobstructed(hand, in_hand, -(X_HS[:3, :3] @ forward))
    across = np.linalg.norm(np.cross(subject.X_SG[:3, 0], forward))
    return float(
        seen.mean()
        + finger_weight * _are_unobstructed(scene, fingers, -forward).mean()
        + side_by_side_weight * across
        + front_weight * (1.0 + np.cos(azimuth)) / 2.0
    )


def _finger_points(subject: ViewedGrasp) -> Array:
    """(N, 3) points of both fingers."""
    half = subject.width / 2.0 + 0.005
    along = -np.linspace(0.0, 0.04, 6)
    points = np.array([[side * half, 0.0, z] for side in (-1.0, 1.0) for z in along])
    return transform_points(subject.X_SG, points)


def _are_unobstructed(rays: RayCaster, points: Array, direction: Array) -> np.ndarray:
    """(N,) whether rays from points in a direction are unobstructed. They start 1 mm off the
    surface.
    """
    face, _ = rays.first_hits(points + 1e-3 * direction, np.tile(direction, (len(points), 1)))
    return np.asarray(face < 0)


TARGET_RIM_COLOR = (230, 60, 0)
"""RGB; an orange that stays dark when printed without colour."""


def mark_target(painting: Painting, placed: Sequence[PlacedBody], target: str) -> Bytes:
    """(H, W, 3) the picture with an outline around the visible target, and other bodies paler."""
    rim_width_share = 1 / 150  # Of the picture's height.
    fading = 0.45  # Blend towards white of bodies other than the target and the hand.
    seen, hand = painting.visible_pixels(placed, target), painting.visible_pixels(placed, HAND_BODY)
    faded = painting.color + fading * (255.0 - painting.color)
    image = np.where((seen | hand)[..., None], painting.color, np.round(faded)).astype(np.uint8)
    width = max(2, round(rim_width_share * image.shape[0]))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * width + 1, 2 * width + 1))
    rim = (cv2.dilate(seen.astype(np.uint8), kernel) > 0) & ~seen
    image[rim] = TARGET_RIM_COLOR
    return image


def write_names(painting: Painting, placed: Sequence[PlacedBody]) -> Bytes:
    """(H, W, 3) the picture with the names of the objects.

    Args:
        painting: picture of the objects.
        placed: bodies of the picture.
    """
    min_pixels = 30  # Objects with fewer visible pixels get no name.
    letter_height_share = 0.042  # Of the picture's height.
    image = painting.color.copy()
    boxes, plates, bodies = [], [], np.zeros(image.shape[:2], dtype=bool)
    for name in dict.fromkeys(
        one.name for one in placed if one.name not in (GROUND_BODY, HAND_BODY)
    ):
        body = painting.visible_pixels(placed, name)
        bodies |= body
        rows, columns = np.nonzero(body)
        if len(rows) >= min_pixels:
            boxes.append([[columns.min(), rows.min()], [columns.max(), rows.max()]])
            height = round(letter_height_share * image.shape[0])
            plates.append(render_tag(name, (255, 255, 255), height))
    if plates:
        draw_tags(image, np.array(boxes, float), plates, bodies)
    return image


def add_shadows(
    painting: Painting, placed: Sequence[PlacedBody], view: Viewpoint, hulls: Sequence[Array]
) -> Painting:
    """Adds soft shadows of convex pieces (N, 3) in S on the ground to a picture."""
    size = np.array([view.intrinsics.width, view.intrinsics.height])
    ahead = [hull for hull in hulls if _is_before_camera(hull, view)]
    light = painted_shadow(ahead, view.X_SC, view.intrinsics.focal[0], size)
    ground = painting.visible_pixels(placed, GROUND_BODY)
    light = np.where(ground, light, 1.0)[..., None]
    return Painting(np.round(painting.color * light).astype(np.uint8), painting.owner)


def _is_before_camera(hull: Array, view: Viewpoint) -> bool:
    """Whether a piece and its shadow are in front of the camera."""
    ground = np.vstack([hull, hull * [1.0, 1.0, 0.0]])
    X_CS = inverse(view.X_SC)
    return bool((ground @ X_CS[2, :3] + X_CS[2, 3] > 0.01).all())


def encode_picture(image: Bytes) -> bytes:
    """Encodes a picture (H, W, 3) as a file."""
    quality = 82  # Per cent.
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(image[..., ::-1]), options)
    return data.tobytes()


GRASP_PICTURE_SIZE = (520, 390)
"""Width and height in pixels."""
SETUP_PICTURE_SIZE = (760, 500)
"""Width and height in pixels."""


class TrialPictures:
    """Makes the pictures of a trials file.

    Args:
        runs: runs of the file.
        rays: use ray casting even if Drake's renderer is available.

    Raises:
        InvalidInputError: a run or grasp is missing, or Drake cannot load a mesh.
    """

    def __init__(self, runs: TriedRuns, *, rays: bool = False) -> None:
        self.runs = runs
        self._scenes: dict[str, _SceneGeometry] = {}
        shown = []
        for trial in runs.sheet.trials:
            if trial.run not in self._scenes:
                tried = runs.of(trial)
                self._scenes[trial.run] = _SceneGeometry(SceneBodies(tried.scene, tried.station))
                shown.append(self._scenes[trial.run].with_hand(np.eye(4), np.nan))
        self._painter: Painter
        if rays or missing_render_libraries():
            self._painter = RayPainter()
        else:
            self._painter = VtkPainter(count_bodies(shown))

    def paint_grasp(
        self, trial: RealTrial, size: tuple[int, int] = GRASP_PICTURE_SIZE
    ) -> tuple[Painting, tuple[PlacedBody, ...], Viewpoint]:
        """Picture of the hand at a trial's grasp among the objects, its placed bodies, and the
        viewpoint.
        """
        scenery, X_SG = self._scenes[trial.run], self.runs.X_SG(trial)
        width = self.runs.width(trial)
        view = scenery.viewpoint(trial.instance, X_SG, width, size)
        placed = scenery.with_hand(X_SG, width)
        painting = self._painter.paint(placed, view)
        hulls = [*scenery.hulls, scenery.bodies.corners(X_SG)]
        return add_shadows(painting, placed, view, hulls), placed, view

    def grasp(self, trial: RealTrial, size: tuple[int, int] = GRASP_PICTURE_SIZE) -> bytes:
        """JPEG of the hand at a trial's grasp among the objects; the target is outlined."""
        painting, placed, _ = self.paint_grasp(trial, size)
        return encode_picture(mark_target(painting, placed, trial.instance))

    def setup(
        self, trial: RealTrial, size: tuple[int, int] = SETUP_PICTURE_SIZE
    ) -> tuple[bytes, bytes]:
        """JPEGs of the scene of a trial without a hand, from above and from the front."""
        front_elevation = np.deg2rad(33.0)  # Downward angle of the front camera [rad].
        scenery = self._scenes[trial.run]
        standing = scenery.bodies.standing
        front = fit_viewpoint(scenery.corners, camera_direction(0.0, front_elevation), size)
        pictures = []
        for view in (viewpoint_from_above(scenery.corners, size), front):
            painting = add_shadows(
                self._painter.paint(standing, view), standing, view, scenery.hulls
            )
            pictures.append(encode_picture(write_names(painting, standing)))
        return pictures[0], pictures[1]


class _SceneGeometry:
    """Bodies of a scene, with cached geometry."""

    def __init__(self, bodies: SceneBodies) -> None:
        self.bodies = bodies
        self._surfaces: dict[str, Array] = {}

    def with_hand(self, X_SG: Array, width: float) -> tuple[PlacedBody, ...]:
        return (*self.bodies.standing, *self.bodies.hand(X_SG, width))

    def viewpoint(
        self, instance: str, X_SG: Array, width: float, size: tuple[int, int]
    ) -> Viewpoint:
        if instance not in self._surfaces:
            scene = self.bodies.scene
            surface = scene.library.surface(scene.instance(instance).object)
            centers = np.asarray(surface.triangles_center)
            self._surfaces[instance] = transform_points(scene.X_SO(instance), centers)
        subject = ViewedGrasp(X_SG, width, self._surfaces[instance], self.bodies.corners(X_SG))
        return grasp_viewpoint(subject, self._rays, self._hand_rays, inverse(X_SG), size)

    @cached_property
    def hulls(self) -> list[Array]:
        """(N, 3) corners in S of the objects' convex pieces."""
        scene, found = self.bodies.scene, []
        for name in (*scene.instances, *scene.background):
            for piece in scene.entry(name).pieces:
                corners = np.asarray(scene.library.mesh(piece).vertices)
                found.append(transform_points(scene.X_SO(name), corners))
        return found

    @cached_property
    def corners(self) -> Array:
        """(N, 3) corners of the board and of the objects on it, in S [m]."""
        x, y = self.bodies.scene.board.size
        board = np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0], [0.0, y, 0.0], [x, y, 0.0]])
        return np.vstack([board, *self.hulls])

    @cached_property
    def _rays(self) -> RayCaster:
        standing = [one for one in self.bodies.standing if one.name != GROUND_BODY]
        vertices, faces, _ = RayPainter().joined(standing)
        return RayCaster(vertices, faces)

    @cached_property
    def _hand_rays(self) -> RayCaster:
        """Ray caster of the open hand, in the grasp frame."""
        vertices, faces, _ = RayPainter().joined(self.bodies.hand(np.eye(4), np.nan))
        return RayCaster(vertices, faces)


class PictureCache:
    """Makes pictures in a thread, from the first request on, and keeps them. `close` ends it.

    A picture's name is `grasp/NUMBER` for a trial, `above/BLOCK` or `front/BLOCK` for a block.

    Args:
        runs: runs of the trials file.
    """

    def __init__(self, runs: TriedRuns) -> None:
        self._runs = runs
        self._trials = {trial.number: trial for trial in runs.sheet.trials}
        self._blocks = {block: trials[0] for block, trials in trials_by_block(runs.sheet).items()}
        self._made: dict[str, bytes] = {}
        self._wanted: deque[str] = deque()
        self._changed = threading.Condition()
        self._closed, self._fault = False, ""
        self._thread = threading.Thread(target=self._make_pictures, name="pictures", daemon=True)

    @property
    def names(self) -> list[str]:
        """Names of pictures in the order in which they are needed. Pictures of a block from the
        front are left out: they are made with those from above.
        """
        names, blocks = [], set[int]()
        for number in sorted(self._trials):
            block = self._trials[number].block
            if block not in blocks:
                blocks.add(block)
                names.append(f"above/{block}")
            names.append(f"grasp/{number}")
        return names

    def close(self) -> None:
        """Ends the thread."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join()

    def get(self, name: str, seconds: float) -> bytes | None:
        """A picture as JPEG; None if the name does not exist, or after a timeout in seconds.

        Raises:
            InvalidInputError: pictures cannot be made.
        """
        kind, _, number = name.partition("/")
        known = self._trials if kind == "grasp" else self._blocks
        if kind not in ("grasp", "above", "front") or not number.isdecimal():
            return None
        if len(number) > 9 or int(number) not in known:
            return None
        with self._changed:
            if not self._has_ended and self._thread.ident is None:
                self._thread.start()
            if name not in self._made:
                self._wanted.append(name)
                self._changed.notify_all()
            self._changed.wait_for(lambda: name in self._made or self._has_ended, seconds)
            return self._made.get(name)

    @property
    def fault(self) -> str:
        """Error that prevents pictures; empty if there is none."""
        return self._fault

    @property
    def _has_ended(self) -> bool:
        return self._closed or bool(self._fault)

    def _make_pictures(self) -> None:
        try:
            pictures = TrialPictures(self._runs)
            ahead = deque(self.names)
            while (name := self._next_name(ahead)) is not None:
                if name not in self._made:
                    self._store(self._make(pictures, name))
            del pictures  # the renderer must end in the thread that created it
        except BurgError as error:
            with self._changed:
                self._fault = str(error)
                self._changed.notify_all()

    def _next_name(self, ahead: deque[str]) -> str | None:
        """Name of the next picture to make; waits until one is wanted. None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._wanted or ahead)
            if self._closed:
                return None
            return self._wanted.pop() if self._wanted else ahead.popleft()

    def _make(self, pictures: TrialPictures, name: str) -> dict[str, bytes]:
        kind, _, number = name.partition("/")
        if kind == "grasp":
            return {name: pictures.grasp(self._trials[int(number)], size=(880, 660))}
        above, front = pictures.setup(self._blocks[int(number)], size=(900, 592))
        return {f"above/{number}": above, f"front/{number}": front}

    def _store(self, made: dict[str, bytes]) -> None:
        with self._changed:
            self._made |= made
            self._changed.notify_all()
