"""`python -m tools.clutter [-o models/clutter]`: writes the library of unlabelled things.

Plain convex shapes of household sizes, which stand beside the objects of training images and belong
to no category of anybody's data set.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import trimesh

from burg_drake.pipeline import ObjectSource, build_library

DEFAULT_OUT = Path(__file__).resolve().parents[1] / "models" / "clutter"
DENSITY = 600.0  # of wood [kg/m3]


def shapes() -> dict[str, tuple[trimesh.Trimesh, tuple[float, float, float]]]:
    """Meshes [m] and colours by name."""
    box, cylinder = trimesh.creation.box, trimesh.creation.cylinder
    wedge = [
        (x, y, z) for x in (-0.03, 0.03) for y, z in ((-0.05, 0.0), (0.05, 0.0), (-0.05, 0.04))
    ]
    base = [(x, y, 0.0) for x in (-0.035, 0.035) for y in (-0.035, 0.035)]
    angles = np.arange(6) * np.pi / 3
    hexagon = [(0.03 * np.cos(a), 0.03 * np.sin(a), z) for a in angles for z in (0.0, 0.045)]
    return {
        "block": (box((0.07, 0.05, 0.035)), (0.76, 0.60, 0.42)),
        "plank": (box((0.16, 0.045, 0.015)), (0.55, 0.36, 0.20)),
        "tower": (box((0.04, 0.04, 0.13)), (0.20, 0.36, 0.52)),
        "drum": (cylinder(0.033, 0.07, sections=32), (0.70, 0.22, 0.18)),
        "coin": (cylinder(0.045, 0.012, sections=32), (0.60, 0.60, 0.62)),
        "rod": (cylinder(0.011, 0.15, sections=24), (0.85, 0.72, 0.20)),
        "cone": (trimesh.creation.cone(0.04, 0.09, sections=32), (0.30, 0.52, 0.32)),
        "wedge": (hull(wedge), (0.46, 0.34, 0.56)),
        "pyramid": (hull([*base, (0.0, 0.0, 0.06)]), (0.78, 0.50, 0.30)),
        "nut": (hull(hexagon), (0.35, 0.37, 0.40)),
    }


def hull(points: list[tuple[float, float, float]]) -> trimesh.Trimesh:
    """The convex hull of points."""
    return trimesh.PointCloud(points).convex_hull


def main() -> int:
    """Builds the library; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=DEFAULT_OUT, help="folder to write")
    sources = [
        ObjectSource(name=name, mesh=mesh, density=DENSITY, rgba=(*color, 1.0))
        for name, (mesh, color) in shapes().items()
    ]
    report = build_library(sources, parser.parse_args().out, name="clutter")
    for name, reason in report.failed.items():
        print(f"{name}: {reason}")
    print(f"{len(report.built)} built, {len(report.cached)} up to date")
    return 1 if report.failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
