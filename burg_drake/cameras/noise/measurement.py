"""All effects of a depth camera on a perfect depth image, in the order in which they happen."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras.noise.axial import axial_noise, depth_steps, disparity_errors
from burg_drake.cameras.noise.document import DepthNoise
from burg_drake.cameras.noise.edges import flying_pixels, lateral_noise
from burg_drake.cameras.noise.holes import dark_probability, grazing_probability, holes
from burg_drake.cameras.noise.shadow import hidden_from_second
from burg_drake.cameras.noise.surfaces import depth_edges, incidence_angle
from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Booleans, Bytes, InvalidInputError, Single


def noisy_depth(
    depth: Single,
    noise: DepthNoise,
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    *,
    normals: Single | None = None,
    color: Bytes | None = None,
) -> Single:
    """A depth image as a camera measures it.

    Edges fray and pixels at them mix; then depth gets its errors and steps; what light does not
    reach or come back from, is lost. The same generator gives the same image. Where nothing was,
    nothing is.

    Args:
        depth: (H, W) without errors [m]; 0 where nothing is.
        noise: what the camera does to it, see `depth_noise` for presets.
        intrinsics: of the image.
        rng: of all that is random.
        normals: (H, W, 3) unit normals of the surfaces in the camera's frame, 0 where nothing is;
            those of the depth image if None.
        color: (H, W, 3) red, green, blue of the same pixels; no surface is dark if None.

    Returns:
        (H, W) depth [m], 0 where nothing is measured; a new array.

    Raises:
        InvalidInputError: an image has another size than the intrinsics or another kind of values,
            or depth is not finite or below 0.
    """
    depth = _checked_depth(depth, intrinsics)
    _check_beside("normals", normals, depth.shape, np.floating)
    _check_beside("color", color, depth.shape, np.uint8)
    angle = incidence_angle(depth, intrinsics, normals) if noise.uses_angles else None
    lost = _lost(depth, angle, noise, intrinsics, rng, color)
    measured = _moved(depth, angle, noise, intrinsics.focal[0], rng)
    measured[lost] = 0.0
    return measured


def _moved(
    depth: Single,
    angle: Single | None,
    noise: DepthNoise,
    focal: float,
    rng: np.random.Generator,
) -> Single:
    """Depth with its errors, before anything is lost."""
    measured = depth.copy()
    if noise.lateral_base or noise.lateral_angle or noise.flying:
        edges = depth_edges(depth)
        if noise.flying:
            measured = flying_pixels(measured, edges, noise, rng)
        if noise.lateral_base or noise.lateral_angle:
            measured = lateral_noise(measured, edges, angle, noise, rng)
    if noise.axial_base or noise.axial_square or noise.axial_angle:
        measured = axial_noise(measured, angle, noise, rng)
    if noise.disparity_sigma or noise.disparity_step:
        measured = disparity_errors(measured, focal, noise, rng)
    if noise.depth_step:
        measured = depth_steps(measured, noise)
    return measured


def _lost(
    depth: Single,
    angle: Single | None,
    noise: DepthNoise,
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    color: Bytes | None,
) -> Booleans:
    """(H, W) pixels that give no depth."""
    kept = np.ones(depth.shape, dtype=np.float32)
    if angle is not None and noise.grazing_from_deg < 90.0:
        kept -= grazing_probability(angle, noise)
    if color is not None and noise.dark_below and noise.dark_probability:
        kept *= 1.0 - dark_probability(color, noise)
    lost = holes(np.float32(1.0) - kept, noise.hole_size, rng)
    if noise.second_view != "none":
        same_view = noise.second_view == "same"
        lost |= hidden_from_second(depth, intrinsics.focal[0], noise.baseline, same_view=same_view)
    return lost


def _checked_depth(depth: Single, intrinsics: Intrinsics) -> Single:
    values = np.asarray(depth)
    if values.ndim != 2 or not np.issubdtype(values.dtype, np.floating):
        raise InvalidInputError(
            f"depth has shape {values.shape} and type {values.dtype}; expected (H, W) floats in"
            " metres"
        )
    intrinsics.require_size(values.shape[1], values.shape[0], "the depth image")
    wrong = ~(np.isfinite(values) & (values >= 0.0))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InvalidInputError(
            f"depth has {np.count_nonzero(wrong)} pixels that are negative or not finite, such as"
            f" {values[row, column]:g} in row {row}, column {column}; use 0 where nothing was"
            " measured"
        )
    return values.astype(np.float32, copy=False)


def _check_beside(
    name: str, image: np.ndarray | None, shape: tuple[int, ...], kind: type[np.generic]
) -> None:
    """Refuses an image of other pixels than those of depth."""
    if image is None:
        return
    if image.shape != (*shape, 3) or not np.issubdtype(image.dtype, kind):
        raise InvalidInputError(
            f"{name} has shape {image.shape} and type {image.dtype}; a depth image of shape"
            f" {shape} needs shape {(*shape, 3)} and type {kind.__name__}"
        )
