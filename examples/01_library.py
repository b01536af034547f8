"""From meshes to simulated objects: build a library from a mesh file, and look at what is in it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import trimesh

import burg_drake as burg

with tempfile.TemporaryDirectory() as folder:
    # A mesh as it comes from CAD: a tube, in millimetres, as .stl.
    mesh_file = Path(folder) / "tube.stl"
    trimesh.creation.annulus(r_min=20, r_max=25, height=80).export(mesh_file)

    millimetre = burg.objects.unit_scale("mm")
    report = burg.build_library(
        [burg.ObjectSource.from_file(mesh_file, scale=millimetre, mass=0.12, friction=0.4)],
        Path(folder) / "my_library",
    )
    for name, message in report.failed.items():
        print(f"{name} failed: {message}")

    tube = report.library.entry("tube")
    size = [1e3 * (b - a) for a, b in zip(tube.lower, tube.upper, strict=True)]
    print(f"tube: {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm, {1e3 * tube.mass:.0f} g")
    moments = ", ".join(f"{1e6 * i:.1f}" for i in tube.mass_properties.inertia[:3])
    print(f"moments of inertia about the centre of mass: {moments} kg mm^2")
    print(f"{len(tube.pieces)} convex pieces, Drake model {tube.sdf}")
    print(f"the pieces are up to {1e3 * tube.fit.hausdorff:.1f} mm off the surface")
    for pose in tube.stable_poses:
        axis = np.round(pose.X_SO.matrix()[:3, 2], 2) + 0.0
        rolls = ", and rolls" if pose.rolls else ""
        print(f"rests with probability {pose.probability:.2f}, its axis along {axis}{rolls}")
