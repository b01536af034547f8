"""Presets of real depth cameras: intrinsics, range, baseline and noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Literal

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.core import (
    FieldError,
    InvalidInputError,
    Ranges,
    UnknownNameError,
    load_document,
    require_ranges,
    suggest_names,
)
from burg_drake.station import HALF_PIXEL

Size = tuple[int, int]
"""Width and height [pixels]."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A depth camera.

    Attributes:
        name: of the preset.
        color, depth: intrinsics of its images, one per aspect; the first is the default.
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
    if name not in SENSOR_PRESETS:
        raise UnknownNameError(
            f"sensor {name!r} does not exist; {suggest_names(str(name), SENSOR_PRESETS)}"
        )
    return SENSOR_PRESETS[name]


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


def _scaled_images(
    camera: str,
    whole: Size,
    focal: tuple[float, float],
    center: tuple[float, float],
    sizes: tuple[Size, ...] = (),
    distortion: tuple[float, ...] = (),
) -> tuple[Intrinsics, ...]:
    """Intrinsics of several image sizes from one calibration: scaled to just cover the size, then
    cropped evenly.

    Args:
        camera: what the calibrations are called.
        whole: size of the calibrated images, which may be a crop of the sensor.
        focal, center: of the calibrated images [pixels].
        sizes: of the images, the usual one first; the whole if none is given.
        distortion: OpenCV's, of all sizes.
    """
    images = []
    for width, height in sizes or (whole,):
        scale = max(width / whole[0], height / whole[1])
        fx, fy = (scale * f for f in focal)
        cx, cy = (
            scale * (c - (n - 1) / 2) + (m - 1) / 2
            for c, n, m in zip(center, whole, (width, height), strict=True)
        )
        images.append(
            Intrinsics(
                camera=camera,
                width=width,
                height=height,
                focal=(fx, fy),
                center=(cx, cy),
                distortion=distortion,
            )
        )
    return tuple(images)


def _distortion(k: tuple[float, ...], p: tuple[float, float]) -> tuple[float, ...]:
    """Radial k1, k2, k3[, k4, k5, k6] and tangential p1, p2 in OpenCV's order: p follows k2."""
    return (*k[:2], *p, *k[2:])


_D400_DATA_SHEET = (
    "Intel RealSense Product Family D400 Series, data sheet 337029-009 of June 2020 (baseline,"
    " ideal range); a device's own calibration as librealsense tells it"
)
"""Source of the RealSense presets."""
_D400_SIZES = ((640, 480), (848, 480), (1280, 720))
"""Sizes of the depth images of RealSense cameras, the usual one first."""

D435 = Sensor(
    name="d435",
    color=_scaled_images(
        "d435 color", (1280, 720), (920.7, 920.8), (635.6, 373.1), ((640, 480), (1280, 720))
    ),
    depth=_scaled_images("d435 depth", (1280, 800), (637.6, 637.6), (638.3, 410.5), _D400_SIZES),
    depth_range=(0.3, 3.0),
    baseline=0.050,
    source=f"{_D400_DATA_SHEET}; no distortion is told",
)
"""Intel RealSense D435, whose depth is that of its left imager."""

D455 = Sensor(
    name="d455",
    color=_scaled_images(
        "d455 color",
        (1280, 800),
        (632.4, 632.0),
        (639.8, 403.3),
        ((640, 480), (1280, 720)),
        _distortion(k=(-0.056522, 0.068801, -0.022386), p=(-0.000717, -0.000025)),
    ),
    depth=_scaled_images("d455 depth", (1280, 800), (641.5, 641.5), (640.4, 403.8), _D400_SIZES),
    depth_range=(0.6, 6.0),
    baseline=0.095,
    source=f"{_D400_DATA_SHEET}. It calls the distortion inverse; users found that OpenCV's model,"
    " as here, is meant",
)
"""Intel RealSense D455, whose depth is that of its left imager."""

AZURE_KINECT = Sensor(
    name="azure_kinect",
    color=_scaled_images(
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
    depth=_scaled_images(
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

_ZIVID_IMAGES = _scaled_images("zivid_two", (1944, 1200), (1805.0, 1805.0), (971.5, 599.5))

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

KINECT_SENSOR = Sensor(
    name="kinect",
    color=_scaled_images("kinect color", (640, 480), (525.0, 525.0), (319.5, 239.5)),
    depth=_scaled_images("kinect depth", (640, 480), (586.3, 586.3), (319.5, 239.5)),
    depth_range=(0.5, 5.0),
    baseline=0.075,
    source="Khoshelham and Elberink, Sensors 12, 2012 (baseline, range, and of depth the focal"
    " length: 5.453 mm over pixels of 9.3 um); the colour camera's is the one usually taken",
)
"""Microsoft Kinect, the first: projected dots."""

SENSOR_PRESETS = {
    preset.name: preset for preset in (D435, D455, AZURE_KINECT, ZIVID_TWO, KINECT_SENSOR)
}
"""Depth cameras by name."""


SecondView = Literal["none", "same", "wide"]
"""View of the second imager or the projector: not modelled; as wide as the camera's; or all that
the camera sees, unless something is in between."""


@dataclass(frozen=True, kw_only=True)
class DepthNoise:
    """Noise of a depth camera. An effect whose figure is 0 does not occur.

    Attributes:
        baseline: x of the second imager, or of the projector, in the camera's frame [m].
        second_view: view of the second imager or the projector; surfaces outside it have no depth.
            `same`: as wide as the camera's. `wide`: all that the camera sees, unless something is
            in between. `none`: all surfaces.
        axial_base: standard deviation of depth at the depth `axial_center` [m]. At the depth z it
            is `axial_base + axial_square (z - axial_center)^2`.
        axial_square: growth of the standard deviation of depth with the squared distance from
            `axial_center` [1/m].
        axial_center: depth at which the standard deviation of depth is smallest [m].
        axial_angle: growth d of the standard deviation of depth at angles of incidence t above 60
            degrees [m^1.5]: d / sqrt(z) (t / (pi/2 - t))^2 is added.
        disparity_sigma: standard deviation of the disparity [pixels].
        disparity_step: step in which disparity is measured [pixels].
        lateral_base: standard deviation of the position of edges in the image [pixels].
        lateral_angle: growth b of that standard deviation with the angle of incidence t [pixels]:
            b t / (pi/2 - t) is added.
        flying: share of the pixels at edges whose depth lies between near and far, 0 to 1.
        grazing_from_deg: angle of incidence from which surfaces have holes [degrees]; 90 for none.
        grazing_to_deg: angle of incidence from which surfaces have no depth at all [degrees].
        dark_below: brightness below which a surface counts as dark, of 255.
        dark_probability: probability of a hole in a black surface, 0 to 1; it falls to 0 at
            `dark_below`.
        hole_size: radius of holes, 1 or more [pixels]; 0 for single pixels.
        depth_step: step in which depth is written [m].

    Raises:
        FieldError: a figure is out of its range, or needs another one that is not there.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "baseline": (-1.0, 1.0),
        "axial_base": (0.0, 1.0),
        "axial_square": (0.0, 1.0),
        "axial_center": (-10.0, 10.0),
        "axial_angle": (0.0, 1.0),
        "disparity_sigma": (0.0, 10.0),
        "disparity_step": (0.0, 10.0),
        "lateral_base": (0.0, 10.0),
        "lateral_angle": (0.0, 10.0),
        "flying": (0.0, 1.0),
        "grazing_from_deg": (0.0, 90.0),
        "grazing_to_deg": (0.0, 90.0),
        "dark_below": (0.0, 255.0),
        "dark_probability": (0.0, 1.0),
        "hole_size": (0.0, 20.0),
        "depth_step": (0.0, 1.0),
    }

    version: int = 1
    baseline: float = 0.0
    second_view: SecondView = "none"
    axial_base: float = 0.0
    axial_square: float = 0.0
    axial_center: float = 0.0
    axial_angle: float = 0.0
    disparity_sigma: float = 0.0
    disparity_step: float = 0.0
    lateral_base: float = 0.0
    lateral_angle: float = 0.0
    flying: float = 0.0
    grazing_from_deg: float = 90.0
    grazing_to_deg: float = 90.0
    dark_below: float = 0.0
    dark_probability: float = 0.0
    hole_size: float = 0.0
    depth_step: float = 0.0

    def __post_init__(self) -> None:
        require_ranges(self)
        if self.grazing_to_deg < self.grazing_from_deg:
            raise FieldError(
                f"grazing_to_deg is {self.grazing_to_deg:g}; it must be at least grazing_from_deg,"
                f" {self.grazing_from_deg:g}",
                "grazing_to_deg",
            )
        if 0.0 < self.hole_size < 1.0:
            raise FieldError(
                f"hole_size is {self.hole_size:g} pixels; it must be 0, or from 1 to 20",
                "hole_size",
            )
        for name in ("disparity_sigma", "disparity_step", "second_view"):
            if not self.baseline and getattr(self, name) not in (0.0, "none"):
                raise FieldError(
                    f"{name} needs the baseline of the sensor, but baseline is 0; give it in"
                    " metres",
                    name,
                )

    def scaled(self, factor: float) -> DepthNoise:
        """The noise with all standard deviations multiplied; holes and flying pixels stay.

        Raises:
            FieldError: a standard deviation would be out of its range.
        """
        names = (
            *("axial_base", "axial_square", "axial_angle", "disparity_sigma"),
            *("lateral_base", "lateral_angle"),
        )
        return replace(self, **{name: factor * getattr(self, name) for name in names})

    @property
    def uses_angles(self) -> bool:
        """Whether some effect depends on the angle of incidence."""
        return bool(self.axial_angle or self.lateral_angle or self.grazing_from_deg < 90.0)


def depth_noise(name: str | Path) -> DepthNoise:
    """Noise by name of a preset, or from a file (`.yaml`).

    Raises:
        UnknownNameError: there is no such preset.
        DocumentError: the file cannot be read, or does not fit.
    """
    if str(name).endswith((".yaml", ".yml")):
        return load_document(name, DepthNoise)
    if name not in NOISE_PRESETS:
        known = suggest_names(str(name), NOISE_PRESETS)
        raise UnknownNameError(f"depth noise {str(name)!r} does not exist; {known}")
    return NOISE_PRESETS[str(name)]


def _realsense_noise(name: str) -> DepthNoise:
    """Disparity: 0.08 pixels of error, which Grunnet-Jepsen recommends (librealsense, issue 3904,
    2019); of a well textured target "Tuning depth cameras for best performance"
    (Grunnet-Jepsen, Sweetser and Woodfill, Intel) expects 0.05 to 0.1. Steps of 1/32: "Subpixel
    linearity improvement for Intel RealSense depth camera D400 series" (Grunnet-Jepsen, Sweetser,
    Khuong, Tong and Woodfill, Intel). Depth in millimetres is the devices' default. The band at
    the left that the second imager does not see is in the data sheet.

    Edges, holes and flying pixels are estimates: edges are the Kinect's. Ahn et al. ("Analysis and
    noise modeling of the Intel RealSense D435 for mobile robots", UR 2019) measured some of it;
    their figures are not in here."""
    return DepthNoise(
        baseline=SENSOR_PRESETS[name].baseline,
        second_view="same",
        disparity_sigma=0.08,
        disparity_step=1.0 / 32.0,
        lateral_base=0.8,
        lateral_angle=0.035,
        flying=0.1,
        grazing_from_deg=75.0,
        grazing_to_deg=88.0,
        dark_below=30.0,
        dark_probability=0.3,
        hole_size=1.5,
        depth_step=0.001,
    )


KINECT_NOISE = DepthNoise(
    baseline=SENSOR_PRESETS["kinect"].baseline,
    second_view="wide",
    axial_base=0.0012,
    axial_square=0.0019,
    axial_center=0.4,
    axial_angle=0.0001,
    lateral_base=0.8,
    lateral_angle=0.035,
    disparity_step=1.0 / 8.0,
    grazing_from_deg=70.0,
    grazing_to_deg=85.0,
    dark_below=40.0,
    dark_probability=0.5,
    hole_size=1.5,
    depth_step=0.001,
)
"""Axial and lateral noise as Nguyen, Izadi and Lovell measured them ("Modeling Kinect sensor noise
for improved 3D reconstruction and tracking", 3DIMPVT 2012, section 2); steps of 1/8 pixel, as
Khoshelham and Elberink have them: 2.85 mm at 1 m, growing with the square ("Accuracy and resolution
of Kinect depth data for indoor mapping applications", Sensors 12, 2012). What Nguyen measured has
the steps in it, so that both together are too much: by 1 % about 0.5 m, 9 % about 1 m and 14 %
about 2 m. Holes are estimates."""

AZURE_KINECT_NOISE = DepthNoise(
    axial_base=0.001,
    axial_square=0.0003,
    axial_center=0.5,
    lateral_base=0.5,
    flying=0.5,
    grazing_from_deg=75.0,
    grazing_to_deg=88.0,
    dark_below=30.0,
    dark_probability=0.6,
    hole_size=1.0,
    depth_step=0.001,
)
"""An estimate: the hardware specifications, which Tölgyessy et al. confirmed ("Evaluation of the
Azure Kinect and its comparison to Kinect v1 and Kinect v2", Sensors 21, 413, 2021), say that the
standard deviation is at most 17 mm, which is a bound for all modes, depths and surfaces. This one
is within 0.6 mm of what BlenderProc derived from that paper (`add_kinect_azure_noise`: 0.5 mm up to
0.5 m, and 1 mm more for each metre). Flying pixels and holes on dark surfaces are described there,
not counted; BlenderProc has edges of 0.25 pixels. The systematic error, less than 11 mm and 0.1 %
of the distance, is not simulated."""

ZIVID_TWO_NOISE = DepthNoise(
    baseline=SENSOR_PRESETS["zivid_two"].baseline,
    second_view="wide",
    axial_square=55e-6 / 0.7**2,
    flying=0.05,
    grazing_from_deg=78.0,
    grazing_to_deg=88.0,
    dark_below=15.0,
    dark_probability=0.3,
    hole_size=2.0,
)
"""Point precision of 55 um at 0.7 m (data sheet of the Zivid 2 M70), that is the local random error
of a point along all three axes (Zivid knowledge base), here all of it along z; it is taken to grow
with the square of the depth, as of all triangulation. Holes and flying pixels are estimates."""

NOISE_PRESETS = {
    "none": DepthNoise(),
    "d435": _realsense_noise("d435"),
    "d455": _realsense_noise("d455"),
    "azure_kinect": AZURE_KINECT_NOISE,
    "zivid_two": ZIVID_TWO_NOISE,
    "kinect": KINECT_NOISE,
}
"""Noise of depth cameras by name."""
