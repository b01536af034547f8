"""The figures of a depth camera's noise, as a document, with presets of real cameras.

Where a preset's docstring names no source for a figure, it is an estimate. What `DepthNoise` does
not have: errors that are the same in every image, such as a bent depth scale or interference of
paths of light, and errors that neighbouring pixels share.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from burg_drake.cameras.optics import SENSORS
from burg_drake.core import FieldError, UnknownNameError, nearest
from burg_drake.core.documents import Ranges, load_document, require_ranges

SecondView = Literal["none", "same", "wide"]
"""What the second imager or the projector sees: it is of no interest; as much as the first one to
each side; all that the first one sees, if nothing is in between."""


@dataclass(frozen=True, kw_only=True)
class DepthNoise:
    """Noise of a depth camera. An effect whose figure is 0 does not occur.

    Attributes:
        baseline: x of the second imager, or of the projector, in the camera's frame [m].
        second_view: what the second imager or the projector sees. Surfaces that it does not see
            have no depth. `same`: as much to each side as the camera. `wide`: all that the camera
            sees, unless something is in between. `none`: all.
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

    @property
    def uses_angles(self) -> bool:
        """Some effect depends on how surfaces are seen."""
        return bool(self.axial_angle or self.lateral_angle or self.grazing_from_deg < 90.0)


def depth_noise(name: str | Path) -> DepthNoise:
    """Noise by name of a preset, or from a file (`.yaml`).

    Raises:
        UnknownNameError: there is no such preset.
        DocumentError: the file cannot be read, or does not fit.
    """
    if str(name).endswith((".yaml", ".yml")):
        return load_document(name, DepthNoise)
    if name not in NOISES:
        known = nearest(str(name), NOISES)
        raise UnknownNameError(f"depth noise {str(name)!r} does not exist; {known}")
    return NOISES[str(name)]


def _realsense(name: str) -> DepthNoise:
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
        baseline=SENSORS[name].baseline,
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
    baseline=SENSORS["kinect"].baseline,
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
    baseline=SENSORS["zivid_two"].baseline,
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

NOISES = {
    "none": DepthNoise(),
    "d435": _realsense("d435"),
    "d455": _realsense("d455"),
    "azure_kinect": AZURE_KINECT_NOISE,
    "zivid_two": ZIVID_TWO_NOISE,
    "kinect": KINECT_NOISE,
}
