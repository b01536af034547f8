"""The moving picture of the README: `python -m tools.film [FILE.webp]`.

A trial of the whole arm, rendered by Drake while it is simulated; then the camera sees the printed
board, and the overlay shows where each object belongs until all are in place.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from pydrake.systems.analysis import Simulator

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import burg_drake as burg
from burg_drake.cameras import Overlay
from burg_drake.core import Pose
from burg_drake.station import Camera

FILE = Path(__file__).resolve().parents[1] / "docs" / "images" / "film.webp"
TARGET = "mug"
SIZE = (720, 540)
SAMPLES = 2
"""Rays along each side of a rendered pixel."""
VIEWS = {
    "trial": (Pose((1.5, -0.9, 0.95), rpy_deg=(-112.0, 0.0, 53.0)), 780.0),
    "board": (Pose((1.08, -0.473, 0.67), rpy_deg=(-128.0, 0.0, 53.0)), 840.0),
}
"""The cameras, in front of the board and to the right of the arm; focal length in pixels."""
FRAMES_PER_SECOND = 12.0
PLACING_TIME, LAST_TIME = 0.55, 2.5
"""How long the picture after each placed object, and the last one, stay [s]."""
QUALITY = 72
"""Of WebP, of 100."""
AWAY = 3.0
"""Objects that are not yet on the board stand so far beside it [m]."""
CAPTION_HEIGHT = 38
FONT = ImageFont.load_default(20)


def captioned(pixels: np.ndarray, words: str) -> Image.Image:
    """An image of Drake's (H, W, 3 or 4) above a line of text."""
    picture = Image.new("RGB", (SIZE[0], SIZE[1] + CAPTION_HEIGHT), (24, 28, 34))
    picture.paste(Image.fromarray(np.ascontiguousarray(pixels[..., :3])))
    place = (16, SIZE[1] + CAPTION_HEIGHT / 2)
    ImageDraw.Draw(picture).text(place, words, fill=(238, 240, 244), font=FONT, anchor="lm")
    return picture


def lifted_plan(scene: burg.Scene, station: burg.Station) -> tuple[burg.Plan, burg.TrialResult]:
    """The first sampled grasp of the target that the whole arm lifts in a trial."""
    planner, trial = burg.Planner(burg.ArmReach(scene, station)), burg.ArmTrial(scene, station)
    grasps = burg.sample_grasps(scene, station, 20, only=[TARGET])
    for X_OG, width in zip(grasps.X_OG, grasps.width, strict=True):
        plan = planner.plan(TARGET, X_OG, float(width))
        if isinstance(plan, burg.Plan):
            result = trial.run(TARGET, X_OG, plan)
            if result.outcome == burg.Outcome.LIFTED:
                return plan, result
    raise SystemExit(f"none of the grasps lifts the {TARGET}")


def film_trial(scene: burg.Scene, station: burg.Station) -> list[tuple[Image.Image, float]]:
    """Pictures of a trial, each with the time that it is shown [s]."""
    plan, result = lifted_plan(scene, station)
    words = {
        "transfer": f"A grasp of the {TARGET}. The arm plans its way to the pregrasp",
        "approach": "Approach: straight, clear of all other objects",
        "close": "Close: with limited force",
        "lift": "Lift: does the grip hold?",
    }
    built = burg.build_station_diagram(scene, station, drivers=True, cameras=["trial"])
    context = built.diagram.CreateDefaultContext()
    simulator = Simulator(built.diagram, context)
    built.diagram.GetInputPort("plan").FixValue(context, plan)
    color_image = built.diagram.GetOutputPort("camera.trial.color_image")
    pictures, step = [], 1.0 / FRAMES_PER_SECOND
    end = 0.0
    for name, phase in plan.phases.items():
        end += phase.duration
        while context.get_time() + step <= end:
            pictures.append((captioned(color_image.Eval(context).data, words[name]), step))
            simulator.AdvanceTo(context.get_time() + step)
    height, force = result.margins.lift, result.margins.pad_force
    held = f"Lifted by {1e3 * height:.0f} mm. Both pads hold the {TARGET}, with {force:.0f} N"
    pictures.append((captioned(color_image.Eval(context).data, held), LAST_TIME))
    return pictures


def film_board(scene: burg.Scene, station: burg.Station) -> list[tuple[Image.Image, float]]:
    """Pictures of the printed board while the scene is set up on it."""
    loop = burg.cameras.build_board_loop(scene, station, camera="board")
    context = loop.diagram.CreateDefaultContext()
    for name in scene.instances:
        X_SO = scene.X_SO(name)
        X_SO[1, 3] += AWAY
        loop.place_object(context, name, X_SO)
    image = loop.diagram.GetOutputPort("overlay_image")
    words = "The printed board: the overlay shows where each object belongs"
    pictures = [(captioned(image.Eval(context).data, words), LAST_TIME)]
    for name in scene.instances:
        loop.place_object(context, name, scene.X_SO(name))
        pictures.append((captioned(image.Eval(context).data, words), PLACING_TIME))
    photo = loop.diagram.GetOutputPort("camera.board.color_image").Eval(context).data[..., :3]
    photo = np.ascontiguousarray(photo)
    check = burg.cameras.check_placement(scene, photo, loop.intrinsics)
    assert check.camera is not None, check.reason
    drawn = Overlay(scene, loop.intrinsics).draw(photo, check.camera.X_SC.matrix(), placement=check)
    pictures.append(
        (captioned(drawn, "The placement check measures how far each object is off"), LAST_TIME)
    )
    return pictures


def main(file: Path = FILE) -> None:
    """Writes the film."""
    scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
    size = {"width": SIZE[0], "height": SIZE[1], "samples": SAMPLES}
    cameras = {
        name: Camera(X_WC=X_WC, focal=(focal, focal), **size)
        for name, (X_WC, focal) in VIEWS.items()
    }
    document = dataclasses.replace(station.document, cameras=cameras)
    station = dataclasses.replace(station, document=document)
    shown = [*film_trial(scene, station), *film_board(scene, station)]
    pictures = [picture for picture, _ in shown]
    durations = [round(1e3 * time) for _, time in shown]
    pictures[0].save(
        file,
        save_all=True,
        append_images=pictures[1:],
        duration=durations,
        loop=0,
        quality=QUALITY,
        method=6,
    )
    size = file.stat().st_size
    print(f"{file}: {len(pictures)} pictures, {sum(durations) / 1e3:.1f} s, {size} bytes")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
