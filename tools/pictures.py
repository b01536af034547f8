"""`python -m tools.pictures`: renders the pictures of the station and the built-in objects.

Those of Meshcat and of the report are screenshots of the pages that the commands write with --html.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
from PIL import Image

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from burg_drake import build_station_diagram, load_library, load_scene, load_station
from burg_drake.core.schema import Pose
from burg_drake.scene.scene import Instance, Scene, SceneDocument
from burg_drake.station.station import Camera, Station

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
PLACES = {
    "mug": (0.10, 0.22, 130.0),
    "bowl": (0.28, 0.20, 0.0),
    "bottle": (0.21, 0.36, 20.0),
    "can": (0.09, 0.36, 0.0),
    "box": (0.50, 0.36, 75.0),
    "banana": (0.44, 0.19, 60.0),
    "screwdriver": (0.14, 0.09, -20.0),
    "scissors": (0.36, 0.09, -20.0),
    "marble": (0.19, 0.17, 0.0),
    "airplane": (0.33, 0.52, 250.0),
}
"""Where the built-in objects stand for their portrait: x, y [m] and yaw [degrees] in S."""


def household() -> Scene:
    """All built-in objects, each in its own standing pose."""
    instances = tuple(
        Instance(object=name, X_SO=Pose((x, y, 0.0), rpy_deg=(0.0, 0.0, yaw)))
        for name, (x, y, yaw) in PLACES.items()
    )
    document = SceneDocument(name="household", library="household", instances=instances)
    return Scene(document, load_library("household"), Path("household.yaml"))


def render(scene: Scene, station: Station, camera: Camera, robot: str, file: str) -> None:
    """Writes one picture."""
    document = dataclasses.replace(station.document, cameras={"portrait": camera})
    station = dataclasses.replace(station, document=document)
    built = build_station_diagram(scene, station, robot=robot, cameras=True)  # type: ignore[arg-type]
    context = built.diagram.CreateDefaultContext()
    pixels = built.diagram.GetOutputPort("camera.portrait.color_image").Eval(context).data
    image = Image.fromarray(np.ascontiguousarray(pixels[..., :3]))
    IMAGES.mkdir(parents=True, exist_ok=True)
    image.save(IMAGES / file, optimize=True)


def main() -> None:
    """Writes all pictures."""
    station = load_station("panda_tabletop")
    overview = station.document.cameras["overview"]
    portrait = dataclasses.replace(overview, width=960, height=720, focal=(1000.0, 1000.0))
    render(load_scene("tabletop_six"), station, portrait, "arm", "station.png")
    nearer = dataclasses.replace(portrait, focal=(1350.0, 1350.0))
    render(load_scene("tabletop_six"), load_station("panda_wsg"), nearer, "arm", "wsg.png")
    # seen from the front of the board, 40 degrees from above
    X_WC = Pose((-0.31, 0.0, 0.82), rpy_deg=(-134.0, 0.0, -90.0))
    close = Camera(X_WC=X_WC, width=960, height=720, focal=(1150.0, 1150.0))
    render(household(), station, close, "none", "household.png")


if __name__ == "__main__":
    main()
