"""How exactly the placement check measures, on rendered photos of displaced objects.

    python benchmarks/placement.py [-n 20] [--scene tabletop_six] [--method silhouette|depth]
                                   [--width 640|1280] [--noise 3] [--absent] [--swapped]

Objects stand 0 to 30 mm and -20 to 20 degrees off their targets; the camera looks at the middle of
the board from 0.6 to 1.0 m, 35 to 70 degrees above it, from all sides. Noise on the photo is normal
[8-bit levels]; on depth it is normal of 1 mm, then rounded to millimetres. The board's pose is
estimated from the photo. Only objects of which more than half can be seen count in the errors.
With --absent one object is missing in every photo. With --swapped two objects stand on each other's
places, which must not come out as measured.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter, defaultdict

import cv2
import numpy as np

from burg_drake.cameras import (
    Intrinsics,
    PinholeView,
    Placement,
    TargetShape,
    check_placement,
    target_shapes,
)
from burg_drake.core import Array, make_pose
from burg_drake.scene import load_scene
from tests.cameras.placement_photo import ScenePhotographer

SEEN = 0.5
DEPTH_NOISE, DEPTH_STEP = 1e-3, 1e-3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=20, help="photos (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="seed of the first (default: 0)")
    parser.add_argument("--scene", default="tabletop_six")
    parser.add_argument("--method", choices=("silhouette", "depth"), default="silhouette")
    parser.add_argument("--width", type=int, choices=(640, 1280), default=640)
    parser.add_argument("--noise", type=float, default=3.0, help="(default: %(default)s)")
    parser.add_argument("--blur", type=float, default=0.0, help="[pixels] (default: 0)")
    parser.add_argument("--absent", action="store_true", help="one object is missing")
    parser.add_argument("--swapped", action="store_true", help="two objects change places")
    parser.add_argument("-v", "--verbose", action="store_true", help="print what is far off")
    cv2.setNumThreads(1)
    Study(parser.parse_args()).run()


class Study:
    """Takes photos, checks them, and compares with the truth."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments
        self.scene = load_scene(arguments.scene)
        self.shapes = target_shapes(self.scene)
        self.photographer = ScenePhotographer(self.scene)
        width = arguments.width
        height = 480 if width == 640 else 720
        self.intrinsics = Intrinsics(
            width=width,
            height=height,
            focal=(width * 600 / 640,) * 2,
            center=((width - 1) / 2, (height - 1) / 2),
        )
        self.errors: dict[str, list[Array]] = defaultdict(list)
        self.statuses: Counter[str] = Counter()
        self.seconds: list[float] = []

    def run(self) -> None:
        for seed in range(self.arguments.first, self.arguments.first + self.arguments.n):
            self.photo(seed)
        self.report()

    def photo(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        X_SC = random_view(rng, np.array([*self.scene.board.size, 0.06]) / 2)
        truth = {name: random_displacement(rng) for name in self.shapes}
        odd = self.odd_ones(rng, list(self.shapes))
        X_SO: dict[str, Array | None] = {n: s.placed(truth[n]) for n, s in self.shapes.items()}
        if self.arguments.absent:
            X_SO[odd[0]] = None
        if self.arguments.swapped:
            a, b = odd
            X_SO |= {a: standing(self.shapes[a], self.shapes[b])}
            X_SO |= {b: standing(self.shapes[b], self.shapes[a])}
        photo = self.photographer.take(X_SC, self.intrinsics, X_SO)
        image = photo.color.astype(float)
        if self.arguments.blur:
            image = cv2.GaussianBlur(image, (0, 0), self.arguments.blur)
        image = np.round(image + rng.normal(0.0, self.arguments.noise, image.shape))
        depth = photo.depth + rng.normal(0.0, DEPTH_NOISE, photo.depth.shape)
        depth = np.where(photo.depth > 0, np.round(depth / DEPTH_STEP) * DEPTH_STEP, 0.0)
        start = time.process_time()
        check = check_placement(
            self.scene,
            np.clip(image, 0, 255).astype(np.uint8),
            self.intrinsics,
            depth=depth.astype(np.float32) if self.arguments.method == "depth" else None,
        )
        self.seconds.append(time.process_time() - start)
        if check.reason:
            print(f"photo {seed}: {check.reason}")
        standing_here = {n: q for n, q in truth.items() if n not in odd}
        view = PinholeView(self.intrinsics.K, (self.intrinsics.width, self.intrinsics.height), X_SC)
        labels = [np.sum(photo.label == i) for i in range(len(self.shapes))]
        for i, (name, placement) in enumerate(check.instances.items()):
            if name in odd:
                self.statuses[f"{'absent' if X_SO[name] is None else 'swapped'}"
                              f": {placement.status}"] += 1  # fmt: skip
                if placement.status == "measured":
                    print(f"photo {seed}: {name} is not there, but: {placement}")
                continue
            whole, _ = view.seen(self.shapes[name], truth[name], np.full(photo.label.shape, np.inf))
            alone = silhouette_area(view, self.shapes[name], truth[name]) / max(whole, 1e-9)
            self.compare(
                seed, name, placement, standing_here[name], float(labels[i] / max(alone, 1.0))
            )

    def odd_ones(self, rng: np.random.Generator, names: list[str]) -> list[str]:
        """Objects that are missing, or change places."""
        count = 2 if self.arguments.swapped else 1 if self.arguments.absent else 0
        return [str(n) for n in rng.choice(names, count, replace=False)]

    def compare(self, seed: int, name: str, found: Placement, q: Array, seen: float) -> None:
        kind = "well seen" if seen > SEEN else "hidden in part"
        self.statuses[f"{kind}: {found.status}"] += 1
        if found.status != "measured" or found.displacement is None:
            if self.arguments.verbose:
                print(f"photo {seed}: {name}, seen {seen:.2f}: {found.status}, {found.reason}")
            return
        assert found.displacement_sd is not None
        turn = np.nan if found.angle is None else wrapped(found.angle - q[2])
        row = np.array(
            [
                *(1e3 * (np.array(found.displacement) - q[:2])),
                np.rad2deg(turn),
                *(1e3 * np.array(found.displacement_sd)),
                np.nan if found.angle_sd is None else np.rad2deg(found.angle_sd),
            ]
        )
        if seen > SEEN:
            self.errors[name].append(row)
        if self.arguments.verbose and (np.hypot(*row[:2]) > 0.7 or abs(row[2]) > 1.0):
            print(f"photo {seed}: {name}, seen {seen:.2f}: off by {row[:3].round(2)},"
                  f" expected {row[3:].round(2)}")  # fmt: skip

    def report(self) -> None:
        print("                  n   displacement [mm]   turn [deg]       within 2 sd [%]")
        print("                      median   95 %       median  95 %     x, y  turn")
        for name, rows in [
            *self.errors.items(),
            ("all", [e for found in self.errors.values() for e in found]),
        ]:
            e = np.array(rows)
            off = np.percentile(np.hypot(e[:, 0], e[:, 1]), [50, 95])
            line = f"{name:<16}{len(e):>4}   {off[0]:6.3f} {off[1]:7.3f}   "
            t = e[~np.isnan(e[:, 2])]
            inside = np.abs(e[:, :2]) < 2.0 * e[:, 3:5]
            if len(t):
                turn = np.percentile(np.abs(t[:, 2]), [50, 95])
                line += f"   {turn[0]:6.3f} {turn[1]:6.3f}    {100 * inside.mean():4.0f}"
                line += f"  {100 * np.mean(np.abs(t[:, 2]) < 2.0 * t[:, 5]):4.0f}"
            else:
                line += f"        -      -    {100 * inside.mean():4.0f}     -"
            print(line)
        print(", ".join(f"{k} {v}" for k, v in sorted(self.statuses.items())))
        print(f"CPU {np.median(self.seconds):.2f} s a photo")


def random_view(rng: np.random.Generator, p_ST: Array) -> Array:
    """(4, 4) a camera that looks at a point, upright."""
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(35, 70))
    out = np.array(
        [
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
        ]
    )
    x = np.cross(-out, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    R_SC = np.stack([x, np.cross(-out, x), -out], axis=1)
    return make_pose(R_SC, p_ST + rng.uniform(0.6, 1.0) * out)


def random_displacement(rng: np.random.Generator) -> Array:
    far, way = rng.uniform(0, 0.03), rng.uniform(0, 2 * np.pi)
    return np.array([far * np.cos(way), far * np.sin(way), np.deg2rad(rng.uniform(-20, 20))])


def standing(shape: TargetShape, place: TargetShape) -> Array:
    """(4, 4) X_SO of an object on another's place."""
    return shape.placed(np.array([*(place.p_SR - shape.p_SR)[:2], 0.0]))


def silhouette_area(view: PinholeView, shape: TargetShape, q: Array) -> float:
    """Pixels of the image that an object would cover if nothing stood before it."""
    return float(np.isfinite(view.depth([(shape, q)])).sum())


def wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


if __name__ == "__main__":
    main()
