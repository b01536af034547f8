"""Depth cameras that one can buy, as presets: intrinsics of their images, range and baseline.

Every camera is calibrated on its own, and differs from these by about a percent. Images of one
camera in several sizes come from the same sensor: scaled, and cut evenly on two sides where the
aspect differs. That is how the sizes below have been derived from one calibration each; those of
the RealSense devices agree with what the devices say themselves at 640 x 480.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from burg_drake.cameras.optics.intrinsics import HALF_PIXEL, Intrinsics
from burg_drake.core import InvalidInputError, UnknownNameError, nearest

Size = tuple[int, int]
"""Width and height [pixels]."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A depth camera.

    Attributes:
        name: of the preset.
        color, depth: intrinsics of its images, one for every aspect; the first is the usual one.
        depth_range: nearest and farthest depth that it is made for [m]; some measure nearer.
        baseline: x of the second imager, or of the projector, in the frame of the depth camera
            [m]; 0 of a time-of-flight camera, which has none.
        source: where the figures are from.
    """

    name: str
    color: tuple[Intrinsics, ...]
    depth: tuple[Intrinsics, ...]
    depth_range: tuple[float, float]
    baseline: float
    source: str

    def color_camera(self, size: Size | None = None) -> Intrinsics:
        """Intrinsics of the colour images, of the usual size if none is given.

        Raises:
            InvalidInputError: the camera has no images of that aspect.
        """
        return self._camera("colour", self.color, size)

    def depth_camera(self, size: Size | None = None) -> Intrinsics:
        """Intrinsics of the depth images, of the usual size if none is given.

        Raises:
            InvalidInputError: the camera has no images of that aspect.
        """
        return self._camera("depth", self.depth, size)

    def _camera(self, kind: str, modes: tuple[Intrinsics, ...], size: Size | None) -> Intrinsics:
        if size is None:
            return modes[0]
        for mode in modes:
            if _same_aspect(mode, *size):
                return scaled(mode, *size)
        known = ", ".join(f"{mode.width} x {mode.height}" for mode in modes)
        raise InvalidInputError(
            f"{self.name} has no {kind} images of {size[0]} x {size[1]} pixels; give a size with"
            f" the aspect ratio of {known}"
        )


def sensor(name: str) -> Sensor:
    """The preset of a depth camera.

    Raises:
        UnknownNameError: there is no such preset.
    """
    if name not in SENSORS:
        raise UnknownNameError(f"sensor {name!r} does not exist; {nearest(str(name), SENSORS)}")
    return SENSORS[name]


def scaled(intrinsics: Intrinsics, width: int, height: int) -> Intrinsics:
    """Intrinsics of the same images in another size.

    An image's edges stay its edges, so that the principal point, which counts from the first
    pixel's centre, moves by a part of a pixel as well. Distortion does not depend on the size.

    Args:
        intrinsics: of the camera.
        width, height: of the scaled images [pixels].

    Raises:
        InvalidInputError: the aspect is another one, by half a row or more.
    """
    if not _same_aspect(intrinsics, width, height):
        fitting = max(1, round(intrinsics.height * width / intrinsics.width))
        raise InvalidInputError(
            f"images of {intrinsics.width} x {intrinsics.height} pixels cannot be scaled to"
            f" {width} x {height}, which has another aspect ratio; {width} x {fitting} would fit"
        )
    sx, sy = width / intrinsics.width, height / intrinsics.height
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    return replace(
        intrinsics,
        width=width,
        height=height,
        focal=(sx * fx, sy * fy),
        center=(sx * (cx + HALF_PIXEL) - HALF_PIXEL, sy * (cy + HALF_PIXEL) - HALF_PIXEL),
        residual=None if intrinsics.residual is None else sx * intrinsics.residual,
        known_to=None if intrinsics.known_to is None else sx * intrinsics.known_to,
    )


def _same_aspect(intrinsics: Intrinsics, width: int, height: int) -> bool:
    fitting = intrinsics.height * width / intrinsics.width
    return width > 0 and height > 0 and abs(height - fitting) <= 0.5


def _images(
    camera: str,
    whole: Size,
    focal: tuple[float, float],
    center: tuple[float, float],
    sizes: tuple[Size, ...] = (),
    distortion: tuple[float, ...] = (),
) -> tuple[Intrinsics, ...]:
    """Images of several sizes, from one calibration: scaled so that the whole just covers them,
    then cut evenly. The whole itself may be a cut of the sensor, which covers smaller scales.

    Args:
        camera: what the calibrations are called.
        whole: size of the calibrated images.
        focal, center: of these [pixels].
        sizes: of the images, the usual one first; the whole if none is given.
        distortion: OpenCV's, of all sizes.
    """
    calibrated = Intrinsics(
        camera=camera,
        width=whole[0],
        height=whole[1],
        focal=focal,
        center=center,
        distortion=distortion,
    )
    return tuple(_cut(calibrated, *size) for size in sizes or (whole,))


def _cut(whole: Intrinsics, width: int, height: int) -> Intrinsics:
    scale = max(width / whole.width, height / whole.height)
    (fx, fy), (cx, cy) = whole.focal, whole.center
    return replace(
        whole,
        width=width,
        height=height,
        focal=(scale * fx, scale * fy),
        center=(
            scale * (cx - (whole.width - 1) / 2) + (width - 1) / 2,
            scale * (cy - (whole.height - 1) / 2) + (height - 1) / 2,
        ),
    )


def _distortion(k: tuple[float, ...], p: tuple[float, float]) -> tuple[float, ...]:
    """Radial k1, k2, k3[, k4, k5, k6] and tangential p1, p2 in OpenCV's order: p follows k2."""
    return (*k[:2], *p, *k[2:])


_D400 = (
    "Intel RealSense Product Family D400 Series, data sheet 337029-009 of June 2020 (baseline,"
    " ideal range); a device's own calibration as librealsense tells it"
)

D435 = Sensor(
    name="d435",
    color=_images(
        "d435 color", (1280, 720), (920.7, 920.8), (635.6, 373.1), ((640, 480), (1280, 720))
    ),
    depth=_images(
        "d435 depth",
        (1280, 800),
        (637.6, 637.6),
        (638.3, 410.5),
        ((640, 480), (848, 480), (1280, 720)),
    ),
    depth_range=(0.3, 3.0),
    baseline=0.050,
    source=f"{_D400}; no distortion is told",
)
"""Intel RealSense D435, whose depth is that of its left imager."""

D455 = Sensor(
    name="d455",
    color=_images(
        "d455 color",
        (1280, 800),
        (632.4, 632.0),
        (639.8, 403.3),
        ((640, 480), (1280, 720)),
        _distortion(k=(-0.056522, 0.068801, -0.022386), p=(-0.000717, -0.000025)),
    ),
    depth=_images(
        "d455 depth",
        (1280, 800),
        (641.5, 641.5),
        (640.4, 403.8),
        ((640, 480), (848, 480), (1280, 720)),
    ),
    depth_range=(0.6, 6.0),
    baseline=0.095,
    source=f"{_D400}. It calls the distortion inverse; users found that OpenCV's model, as here, is"
    " meant",
)
"""Intel RealSense D455, whose depth is that of its left imager."""

AZURE_KINECT = Sensor(
    name="azure_kinect",
    color=_images(
        "azure_kinect color",
        (2048, 1536),
        (964.418, 963.756),
        (1016.870, 784.185),
        ((1280, 720), (2048, 1536)),
        _distortion(
            k=(0.722746, -2.885590, 1.632723, 0.602199, -2.719626, 1.565053),
            p=(0.000783, -0.000143),
        ),
    ),
    depth=_images(
        "azure_kinect depth",
        (640, 576),
        (503.928, 503.979),
        (332.064, 325.881),
        distortion=_distortion(
            k=(3.130577, 2.324939, 0.130416, 3.458652, 3.350115, 0.662942),
            p=(0.000081, -0.000051),
        ),
    ),
    depth_range=(0.5, 3.86),
    baseline=0.0,
    source="Microsoft, Azure Kinect DK hardware specifications (NFOV unbinned: 640 x 576, 0.5 to"
    " 3.86 m); a device's own calibration as the Sensor SDK tells it",
)
"""Microsoft Azure Kinect: time of flight, in the mode NFOV unbinned."""

_ZIVID_IMAGES = _images("zivid_two", (1944, 1200), (1805.0, 1805.0), (971.5, 599.5))

ZIVID_TWO = Sensor(
    name="zivid_two",
    color=_ZIVID_IMAGES,
    depth=_ZIVID_IMAGES,
    depth_range=(0.3, 1.5),
    baseline=0.11,
    source="Zivid 2 M70, data sheet (range; 754 mm over 1944 pixels at a distance of 700 mm). The"
    " projector is on the side of x (Zivid knowledge base, camera coordinate system); how far is"
    " an estimate from the housing, 169 mm wide. Points are told without distortion",
)
"""Zivid 2 M70: coded light, colour and depth through the same lens."""

KINECT = Sensor(
    name="kinect",
    color=_images("kinect color", (640, 480), (525.0, 525.0), (319.5, 239.5)),
    depth=_images("kinect depth", (640, 480), (586.3, 586.3), (319.5, 239.5)),
    depth_range=(0.5, 5.0),
    baseline=0.075,
    source="Khoshelham and Elberink, Sensors 12, 2012 (baseline, range, and of depth the focal"
    " length: 5.453 mm over pixels of 9.3 um); the colour camera's is the one usually taken",
)
"""Microsoft Kinect, the first: projected dots."""

SENSORS = {preset.name: preset for preset in (D435, D455, AZURE_KINECT, ZIVID_TWO, KINECT)}
