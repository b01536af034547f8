"""Add the errors of a depth camera to a perfect depth image.

`noisy_depth` adds flying pixels, lateral and axial noise and quantization. Then it removes
pixels in holes and pixels that the second imager does not see.
"""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from scipy.special import ndtri

from burg_drake.cameras.depth_camera_presets import DepthNoise
from burg_drake.cameras.intrinsics import FieldOfView, Intrinsics
from burg_drake.core import Array, Booleans, Bytes, Indices, InvalidInputError, Single


def noisy_depth(
    depth: Single,
    noise: DepthNoise,
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    *,
    normals: Single | None = None,
    color: Bytes | None = None,
) -> Single:
    """Adds the noise of a depth camera to a depth image.

    Edges get lateral noise and flying pixels; depth gets axial noise and quantization; occluded,
    grazing and dark pixels are removed. Equal generators give equal images. Pixels without depth
    stay without.

    Args:
        depth: (H, W) without errors [m]; 0 for none.
        noise: noise of the camera, see `depth_noise` for presets.
        intrinsics: of the image.
        rng: random generator.
        normals: (H, W, 3) unit normals of the surfaces in the camera's frame, 0 for none; computed
            from the depth image if None.
        color: (H, W, 3) red, green, blue of the same pixels; no surface is dark if None.

    Returns:
        (H, W) depth [m], 0 where none is measured; a new array.

    Raises:
        InvalidInputError: an image differs from the intrinsics in size or has the wrong type, or
            depth is not finite or below 0.
    """
    depth = _checked_depth(depth, intrinsics)
    _check_image_shape("normals", normals, depth.shape, np.floating)
    _check_image_shape("color", color, depth.shape, np.uint8)
    angle = incidence_angle(depth, intrinsics, normals) if noise.uses_angles else None
    missing = _missing_pixels(depth, angle, noise, intrinsics.focal[0], rng, color)
    measured = _add_depth_errors(depth, angle, noise, intrinsics.focal[0], rng)
    measured[missing] = 0.0
    return measured


def _add_depth_errors(
    depth: Single,
    angle: Single | None,
    noise: DepthNoise,
    focal: float,
    rng: np.random.Generator,
) -> Single:
    """Adds edge and depth errors, before pixels are removed."""
    measured = depth.copy()
    if noise.lateral_base or noise.lateral_angle or noise.flying:
        edges = depth_edges(depth)
        if noise.flying:
            measured = add_flying_pixels(measured, edges, noise, rng)
        if noise.lateral_base or noise.lateral_angle:
            measured = add_lateral_noise(measured, edges, angle, noise, rng)
    if noise.axial_base or noise.axial_square or noise.axial_angle:
        measured = add_axial_noise(measured, angle, noise, rng)
    if noise.disparity_sigma or noise.disparity_step:
        measured = add_disparity_noise(measured, focal, noise, rng)
    if noise.depth_step:
        # In whole multiples, as cameras write it.
        step = np.float32(noise.depth_step)
        measured = np.asarray(step * np.rint(measured / step))
    return measured


def _missing_pixels(
    depth: Single,
    angle: Single | None,
    noise: DepthNoise,
    focal: float,
    rng: np.random.Generator,
    color: Bytes | None,
) -> Booleans:
    """(H, W) pixels without measured depth."""
    kept = np.ones(depth.shape, dtype=np.float32)
    if angle is not None and noise.grazing_from_deg < 90.0:
        kept -= grazing_probability(angle, noise)
    if color is not None and noise.dark_below and noise.dark_probability:
        kept *= 1.0 - dark_probability(color, noise)
    holes = random_holes(np.float32(1.0) - kept, noise.hole_size, rng)
    if noise.second_view != "none":
        same = noise.second_view == "same"
        holes |= hidden_from_second_imager(depth, focal, noise.baseline, same_view=same)
    return holes


def _checked_depth(depth: Single, intrinsics: Intrinsics) -> Single:
    values = np.asarray(depth)
    if values.ndim != 2 or not np.issubdtype(values.dtype, np.floating):
        raise InvalidInputError(
            f"depth has shape {values.shape} and type {values.dtype}; expected (H, W) floats in"
            " metres"
        )
    intrinsics.require_size(values.shape[1], values.shape[0], "the depth image")
    invalid = ~(np.isfinite(values) & (values >= 0.0))
    if invalid.any():
        row, column = np.argwhere(invalid)[0]
        raise InvalidInputError(
            f"depth has {np.count_nonzero(invalid)} pixels that are negative or not finite, such as"
            f" {values[row, column]:g} in row {row}, column {column}; use 0 where nothing was"
            " measured"
        )
    return values.astype(np.float32, copy=False)


def _check_image_shape(
    name: str, image: np.ndarray | None, shape: tuple[int, ...], kind: type[np.generic]
) -> None:
    """Checks that an image has the depth image's size."""
    if image is None:
        return
    if image.shape != (*shape, 3) or not np.issubdtype(image.dtype, kind):
        raise InvalidInputError(
            f"{name} has shape {image.shape} and type {image.dtype}; a depth image of shape"
            f" {shape} needs shape {(*shape, 3)} and type {kind.__name__}"
        )


DEPTH_EDGE_THRESHOLD = 0.01
"""Least second difference of inverse depth at an edge, as a fraction of the inverse depth."""


def inverse_depth(depth: Single) -> Single:
    """(H, W) 1 / z [1/m]; 0 without depth."""
    return np.reciprocal(np.where(depth > 0.0, depth, np.float32(np.inf)))


def depth_edges(depth: Single) -> Booleans:
    """(H, W) pixels with another surface, or none, beside them in their row or column.

    Args:
        depth: (H, W) [m], 0 for none.
    """
    w = inverse_depth(depth)
    limit = np.float32(DEPTH_EDGE_THRESHOLD) * w
    edges = np.zeros(depth.shape, dtype=bool)
    for turned, bound, found in ((w, limit, edges), (w.T, limit.T, edges.T)):
        second = turned[:, :-2] + turned[:, 2:]
        second -= 2.0 * turned[:, 1:-1]
        found[:, 1:-1] |= np.abs(second, out=second) > bound[:, 1:-1]
    return edges & (depth > 0.0)


def incidence_angle(depth: Single, intrinsics: Intrinsics, normals: Single | None = None) -> Single:
    """(H, W) angle between surface normal and viewing ray [rad]; 0 without depth.

    Args:
        depth: (H, W) [m], 0 for none.
        intrinsics: of the camera.
        normals: (H, W, 3) unit normals in the camera's frame; computed from the depth image if
            None, as if the lens had no distortion.
    """
    if normals is None:
        cosine = _incidence_cosine(inverse_depth(depth), intrinsics)
    else:
        products = cv2.multiply(np.asarray(normals, dtype=np.float32), _pixel_rays(intrinsics))
        cosine = np.abs(cv2.transform(products, np.ones((1, 3), np.float32)))
    angle: Single = np.arccos(np.minimum(cosine, np.float32(1.0)))
    return np.where(depth > 0.0, angle, np.float32(0.0))


def _incidence_cosine(w: Single, intrinsics: Intrinsics) -> Single:
    """A plane n . X = 1 has w = n . r, with the ray r = X / z; so its slopes over the image are
    n_x / f_x and n_y / f_y, and the cosine between n and r is w / (|n| |r|)."""
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    x = ((np.arange(w.shape[1]) - cx) / fx).astype(np.float32)
    y = ((np.arange(w.shape[0])[:, None] - cy) / fy).astype(np.float32)
    nx = np.float32(fx) * _slope(w)
    ny = np.float32(fy) * _slope(np.ascontiguousarray(w.T)).T
    nz = w - nx * x
    nz -= ny * y
    squares = nx * nx
    squares += ny * ny
    squares += nz * nz
    squares *= x * x + y * y + np.float32(1.0)
    np.maximum(squares, np.float32(np.finfo(np.float32).tiny), out=squares)
    return np.asarray(w / np.sqrt(squares))


def _slope(w: Single) -> Single:
    """(H, W) change along the rows per pixel, towards the neighbour with the smaller change, which
    is taken to be on the same surface.
    """
    steps = np.diff(w, axis=1)
    slope = np.empty_like(w)
    slope[:, 0], slope[:, 1:] = steps[:, 0], steps
    sizes = np.abs(steps)
    np.copyto(slope[:, 1:-1], steps[:, 1:], where=sizes[:, 1:] < sizes[:, :-1])
    return slope


@lru_cache(maxsize=2)
def _pixel_rays(intrinsics: Intrinsics) -> Single:
    """(H, W, 3) unit vectors of the pixels' rays in the camera's frame."""
    directions = FieldOfView(intrinsics).directions
    lengths = np.linalg.norm(directions, axis=-1, keepdims=True)
    rays: Single = (directions / lengths).astype(np.float32)
    rays.setflags(write=False)
    return rays


MAX_NOISE_ANGLE = math.radians(82.0)
"""Radians. At larger angles noise stays constant; the formulas would diverge at 90 degrees."""


def axial_sigma(depth: Single, angle: Single | None, noise: DepthNoise) -> Single:
    """(H, W) standard deviation of depth [m].

    `a + b (z - c)^2`, and beyond 60 degrees in addition `d / sqrt(z) (t / (pi/2 - t))^2`, with the
    angle t (Nguyen, Izadi and Lovell 2012, equations of the axial noise). They turned a plane in
    the image's middle; here t is the angle to the ray. As in their model, the second term begins
    with a step (0.4 mm at 1 m).

    Args:
        depth: (H, W) [m], 0 for none.
        angle: (H, W) of incidence [rad]; None if `axial_angle` is 0.
        noise: a, b, c and d are `axial_base`, `axial_square`, `axial_center` and `axial_angle`.
    """
    sigma: Single = np.float32(noise.axial_square) * np.square(
        depth - np.float32(noise.axial_center)
    )
    sigma += np.float32(noise.axial_base)
    if noise.axial_angle and angle is not None:
        # Radians. Noise does not depend on smaller angles (Nguyen et al. 2012).
        steep = (angle > math.radians(60.0)) & (depth > 0.0)
        t = np.minimum(angle[steep], np.float32(MAX_NOISE_ANGLE))
        growth = np.square(t / (np.float32(np.pi / 2) - t))
        sigma[steep] += np.float32(noise.axial_angle) * growth / np.sqrt(depth[steep])
    return sigma


def add_axial_noise(
    depth: Single, angle: Single | None, noise: DepthNoise, rng: np.random.Generator
) -> Single:
    """Adds independent normal errors with the standard deviation `axial_sigma` to depth."""
    moved = rng.standard_normal(depth.shape, dtype=np.float32)
    moved *= axial_sigma(depth, angle, noise)
    moved += depth
    return _drop_invalid(moved, depth)


def add_disparity_noise(
    depth: Single, focal: float, noise: DepthNoise, rng: np.random.Generator
) -> Single:
    """Adds normal errors of `disparity_sigma` to the disparities and rounds to `disparity_step`.

    While errors are small against z, the depth's standard deviation is `z^2 sigma / (f b)`
    (Grunnet-Jepsen, Sweetser and Woodfill, "Tuning depth cameras for best performance"; Keselman et
    al., "Intel RealSense stereoscopic depth cameras", CVPR workshops 2017, equation 2), and steps
    are `z^2 step / (f b)` apart (Khoshelham and Elberink, Sensors 12, 2012). Disparities of 0 or
    less give no depth.

    Args:
        depth: (H, W) [m], 0 for none.
        focal: f_x [pixels].
        noise: with sigma and step, either of which may be 0, and the baseline b.
        rng: random generator; not used without errors.
    """
    scale = np.float32(focal * abs(noise.baseline))
    disparity = scale * inverse_depth(depth)
    if noise.disparity_sigma:
        errors = rng.standard_normal(depth.shape, dtype=np.float32)
        errors *= np.float32(noise.disparity_sigma)
        disparity += errors
    if noise.disparity_step:
        disparity /= np.float32(noise.disparity_step)
        np.rint(disparity, out=disparity)
        disparity *= np.float32(noise.disparity_step)
    disparity[disparity <= 0.0] = np.inf
    return _drop_invalid(np.asarray(scale / disparity), depth)


def _drop_invalid(moved: Single, depth: Single) -> Single:
    """Removes pixels that had no depth, or whose noisy depth is not positive."""
    return np.where((depth > 0.0) & (moved > 0.0), moved, np.float32(0.0))


def lateral_sigma(angle: Single | Array, noise: DepthNoise) -> Array:
    """Standard deviation of an edge's position along rows and columns [pixels].

    `a + b t / (pi/2 - t)`, with the angle of incidence t (Nguyen, Izadi and Lovell 2012, the
    equation of the lateral noise in pixels).

    Args:
        angle: of incidence, of any shape [rad].
        noise: a and b are `lateral_base` and `lateral_angle`.
    """
    t = np.minimum(np.asarray(angle, dtype=float), MAX_NOISE_ANGLE)
    return np.asarray(noise.lateral_base + noise.lateral_angle * t / (np.pi / 2 - t))


def add_lateral_noise(
    depth: Single,
    edges: Booleans,
    angle: Single | None,
    noise: DepthNoise,
    rng: np.random.Generator,
) -> Single:
    """Frays edges: pixels near them take the depth of a pixel a random step away.

    Only pixels near an edge are changed: lateral noise was measured at edges, and inside a surface
    it would add to the axial noise, which already includes it. Barron and Malik ("Intrinsic scene
    properties from a single RGB-D image", CVPR 2013) and Handa et al. ("A benchmark for RGB-D
    visual odometry, 3D reconstruction and SLAM", ICRA 2014) displace all pixels, by a standard
    deviation of half a pixel, and interpolate, which puts pixels in between.

    Args:
        depth: (H, W) [m], 0 for none.
        edges: (H, W) see `depth_edges`.
        angle: (H, W) of incidence [rad]; 0 everywhere if None.
        noise: see `lateral_sigma`.
        rng: random generator.
    """
    largest = float(lateral_sigma(np.array(MAX_NOISE_ANGLE if angle is not None else 0.0), noise))
    # Pixels up to three standard deviations from an edge are changed.
    size = 2 * int(np.ceil(3.0 * largest)) + 1
    near = cv2.dilate(edges.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
    rows, columns = np.divmod(np.flatnonzero(near & (depth > 0.0)), depth.shape[1])
    sigma = lateral_sigma(np.zeros(len(rows)) if angle is None else angle[rows, columns], noise)
    steps = np.rint(sigma * rng.standard_normal((2, len(rows)), dtype=np.float32)).astype(np.intp)
    height, width = depth.shape
    frayed = depth.copy()
    frayed[rows, columns] = depth[
        np.clip(rows + steps[0], 0, height - 1), np.clip(columns + steps[1], 0, width - 1)
    ]
    return frayed


def add_flying_pixels(
    depth: Single, edges: Booleans, noise: DepthNoise, rng: np.random.Generator
) -> Single:
    """Moves a share of the pixels at edges to random depths between near and far.

    A pixel that sees two surfaces measures a mixture ("Color-guided flying pixel correction in
    depth images", arXiv 2410.08084); the mixing ratio is random here, an estimate. Edges without a
    surface behind them have none.

    Args:
        depth: (H, W) [m], 0 for none.
        edges: (H, W) see `depth_edges`.
        noise: `flying` is the share.
        rng: random generator.
    """
    around = np.ones((3, 3), np.uint8)
    far = cv2.dilate(depth, around)
    near = cv2.erode(np.where(depth > 0.0, depth, np.float32(np.inf)), around)
    rows, columns = np.divmod(np.flatnonzero(edges & (depth > 0.0)), depth.shape[1])
    low, high = near[rows, columns], far[rows, columns]
    mixed = rng.random(len(rows)) < noise.flying
    mixed &= high - low > DEPTH_EDGE_THRESHOLD * low
    part = rng.random(len(rows), dtype=np.float32)
    result = depth.copy()
    result[rows[mixed], columns[mixed]] = (low + part * (high - low))[mixed]
    return result


def hidden_from_second_imager(
    depth: Single, focal: float, baseline: float, *, same_view: bool
) -> Booleans:
    """Finds pixels whose points are hidden from a second imager beside the camera.

    The second imager sees pixel u of depth z at `u - f b / z`, in the same row. A box at z1 before
    a wall at z2 casts a shadow of `f b (1 / z1 - 1 / z2)` pixels on its left if the second imager
    is on the right. Points that the camera does not see hide nothing. Images are assumed to be
    rectified.

    Args:
        depth: (H, W) [m], 0 for none.
        focal: f_x [pixels].
        baseline: x of the second centre in the camera's frame [m].
        same_view: the second image is as wide as the first, so that it misses a band on the
            opposite side; else it sees all points that are not hidden.

    Returns:
        (H, W) True for hidden pixels; False without depth.
    """
    if baseline < 0.0:
        turned = hidden_from_second_imager(depth[:, ::-1], focal, -baseline, same_view=same_view)
        return turned[:, ::-1]
    seen = depth > 0.0
    disparity = np.float32(focal * baseline) * inverse_depth(depth)
    second_columns = np.arange(depth.shape[1], dtype=np.float32) - disparity
    hidden = np.zeros(depth.shape, dtype=bool)
    overtaken = np.flatnonzero(_overtaken_pixels(second_columns, disparity) & seen)
    if len(overtaken):
        nearest, pixels = _second_view_disparity(second_columns, disparity)
        # Half a pixel more disparity than another surface is needed to hide it.
        is_nearer = nearest.ravel()[pixels.ravel()[overtaken]] > disparity.ravel()[overtaken] + 0.5
        hidden.ravel()[overtaken[is_nearer]] = True
    if same_view:
        hidden |= seen & (second_columns < -0.5)
    return hidden


def _overtaken_pixels(second_columns: Single, disparity: Single) -> Booleans:
    """Finds pixels for which a pixel further right appears further left in the second image, whose
    columns are `second_columns`. Surfaces that both imagers see have no such pixels, however steep
    they are. A nearer surface starts half a pixel before the centre of its first pixel. Pixels
    without depth hide nothing.
    """
    starts = second_columns.copy()
    nearer = disparity[:, 1:] > disparity[:, :-1] + np.float32(1.0)
    np.subtract(starts[:, 1:], np.float32(0.5), out=starts[:, 1:], where=nearer)
    leftmost = np.minimum.accumulate(starts[:, ::-1], axis=1)[:, ::-1]
    overtaken = np.zeros(second_columns.shape, dtype=bool)
    np.greater(second_columns[:, :-1], leftmost[:, 1:], out=overtaken[:, :-1])
    return overtaken


def _second_view_disparity(second_columns: Single, disparity: Single) -> tuple[Single, Indices]:
    """Largest disparity at each pixel of the second image (H, V), which is extended to the left by
    up to two widths; and flat indices (H, W) into it of the first image's pixels. Gaps of one
    pixel, as in stretched surfaces, are filled.
    """
    height, width = second_columns.shape
    left = min(int(np.ceil(disparity.max())) + 1, 2 * width)
    image = np.zeros((height, left + width), dtype=np.float32)
    pixels = np.rint(np.maximum(second_columns, np.float32(-left))).astype(np.intp)
    pixels += (left + image.shape[1] * np.arange(height))[:, None]
    np.maximum.at(image.ravel(), pixels.ravel(), disparity.ravel())
    return cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((1, 3), np.uint8)), pixels


def grazing_probability(angle: Single, noise: DepthNoise) -> Single:
    """(H, W) probability of a hole: 0 up to `grazing_from_deg`, 1 from `grazing_to_deg` on, linear
    in between.

    Args:
        angle: (H, W) of incidence [rad].
        noise: with the two angles.
    """
    low, high = np.deg2rad([noise.grazing_from_deg, noise.grazing_to_deg])
    if high <= low:
        return np.asarray(angle > low, dtype=np.float32)
    rising: Single = (angle - np.float32(low)) / np.float32(high - low)
    return np.clip(rising, 0.0, 1.0)


def dark_probability(color: Bytes, noise: DepthNoise) -> Single:
    """(H, W) probability of a hole: `dark_probability` at black, 0 from `dark_below` on, linear in
    the luma (ITU-R BT.601) in between.

    Args:
        color: (H, W, 3) red, green, blue.
        noise: with the two figures.
    """
    luma = cv2.cvtColor(np.ascontiguousarray(color), cv2.COLOR_RGB2GRAY).astype(np.float32)
    dark = np.maximum(np.float32(1.0) - luma / np.float32(noise.dark_below), np.float32(0.0))
    return np.asarray(np.float32(noise.dark_probability) * dark)


def random_holes(probability: Single, size: float, rng: np.random.Generator) -> Booleans:
    """Random holes.

    Args:
        probability: (H, W) of a hole in each pixel; accurate within 0.005 with patches.
        size: standard deviation of the Gaussian that forms patches, at least 1 [pixels]; 0 for
            single pixels.
        rng: random generator.

    Returns:
        (H, W) True in a hole.
    """
    if not probability.any():
        return np.zeros(probability.shape, dtype=bool)
    if size == 0.0:
        return rng.random(probability.shape, dtype=np.float32) < probability
    found = probability >= 1.0
    unsure = (probability > 0.0) & ~found
    field = _smooth_field(probability.shape, size, rng)
    found[unsure] = field[unsure] < ndtri(probability[unsure])
    return found


def _smooth_field(shape: tuple[int, ...], size: float, rng: np.random.Generator) -> Single:
    """(H, W) standard normal numbers, correlated between neighbours: smoothed uniform ones, whose
    distribution function differs from the normal one by less than 0.005.
    """
    margin = int(np.ceil(3.0 * size))
    kernel = cv2.getGaussianKernel(2 * margin + 1, size, cv2.CV_32F)
    kernel /= np.linalg.norm(kernel)  # so that the smoothed field has unit variance
    height, width = shape
    wide = (height + 2 * margin, width + 2 * margin)
    uniform = rng.random(wide, dtype=np.float32)
    uniform -= np.float32(0.5)
    uniform *= np.float32(np.sqrt(12.0))
    field = cv2.sepFilter2D(uniform, -1, kernel, kernel)
    return np.asarray(field[margin : margin + height, margin : margin + width])
