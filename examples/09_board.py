"""The board: print it, see it with a simulated camera, and see where each object belongs."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from pydrake.math import RigidTransform, RollPitchYaw

import burg_drake as burg

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
printout = burg.print_board(scene)
print(f"{len(scene.board.layout.ids)} markers on {len(printout.tiling.tiles)} pages of A4")

# simulated camera -> pose of the camera over the board -> overlay, in one Drake diagram
loop = burg.cameras.build_board_loop(scene, station, camera="board")
context = loop.diagram.CreateDefaultContext()
views = {
    "as in the station": loop.X_SC(context),
    "from the side": RigidTransform(RollPitchYaw(-2.4, 0.0, 0.6), [0.7, -0.3, 0.6]).GetAsMatrix4(),
    "from above": RigidTransform(RollPitchYaw(np.pi, 0.0, 0.3), [0.3, 0.2, 0.9]).GetAsMatrix4(),
}
for view, X_SC in views.items():
    loop.place_camera(context, X_SC)
    estimate = loop.diagram.GetOutputPort("board.estimate").Eval(context)
    error = 1e3 * np.linalg.norm(estimate.X_SC[:3, 3] - X_SC[:3, 3])
    print(f"{view}: {len(estimate.ids)} markers seen, camera off by {error:.2f} mm")

# The mug is somewhere else; the overlay shows where it should be.
X_SO = scene.X_SO("mug")
X_SO[:2, 3] += [0.05, -0.1]
loop.place_object(context, "mug", X_SO)
overlay = loop.diagram.GetOutputPort("overlay_image").Eval(context).data

with tempfile.TemporaryDirectory() as folder:
    printout.save(Path(folder, "board.pdf"))
    Image.fromarray(np.ascontiguousarray(overlay[..., :3])).save(Path(folder, "overlay.png"))
    for path in sorted(Path(folder).iterdir()):
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")
