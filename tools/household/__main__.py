"""`python -m tools.household [-o models/household]`: writes the default object library."""

from __future__ import annotations

import argparse
from pathlib import Path

from burg_drake.objects import face_palette
from burg_drake.pipeline import ObjectSource, build_library

from . import household_shapes
from .shape import Shape

DEFAULT_OUT = Path(__file__).resolve().parents[2] / "models" / "household"


def source(shape: Shape) -> ObjectSource:
    """What the library is built from."""
    return ObjectSource(
        name=shape.name,
        mesh=shape.mesh,
        mass=shape.mass,
        pieces=shape.pieces,
        rgba=shape.rgba if face_palette(shape.mesh) is None else None,
        description=f"{shape.description}; {shape.notes}",
    )


def main() -> int:
    """Builds the library; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=DEFAULT_OUT, help="folder to write")
    out = parser.parse_args().out
    shapes = household_shapes()
    report = build_library([source(shape) for shape in shapes], out, name="household")
    for shape in shapes:
        size = " x ".join(f"{1000.0 * e:.0f}" for e in shape.mesh.extents)
        print(
            f"{shape.name:12s} {1000.0 * shape.mass:4.0f} g  {size:15s} mm "
            f"{len(shape.mesh.faces):5d} faces  {len(shape.pieces):2d} pieces"
        )
    for name, reason in report.failed.items():
        print(f"{name}: {reason}")
    print(f"{len(report.built)} built, {len(report.cached)} up to date in {out}")
    return 1 if report.failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
