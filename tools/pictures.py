"""Pictures for the docs: `python -m tools.pictures [KIND ...]`.

`station` renders those of stations and the built-in objects by Drake, `board` what a camera over
the board sees, with the overlay, `overlay` the latter after a placement check, and its live page.
`pages` takes those of grasps by outcome and by a column, of a replay, of frames and of a
reachability map from the pages that the commands write with --html, by a Chromium that runs without
a display; `report` that of a run; `trials` the page for the lab, and simulation beside what stands
for a robot; `library` the sheet of the built-in objects; `calibration` that of a camera; `dataset`
samples on a sheet; `printout` the board on one page; `ports` what the example of the ports shows in
Meshcat; `sampled` renders a scene of each layout, `renderers` one by Drake and by Blender; `setup`
takes those of the setup page. What is served live needs playwright. Graphs are drawn by
benchmarks/confidence.py and benchmarks/convergence.py, the film by tools/film.py.
"""

from __future__ import annotations

import dataclasses
import runpy
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import burg_drake as burg
from burg_drake.apps import main as burg_drake
from burg_drake.cameras import Overlay, build_board_loop, check_placement, save_intrinsics
from burg_drake.core import Pose, rot_z
from burg_drake.evaluation import load_run
from burg_drake.generation import sample_scene
from burg_drake.objects import load_library
from burg_drake.scene import Instance, LayoutName, Scene, SceneDocument, SceneRecipe, load_scene
from burg_drake.station import Camera, Station, build_station_diagram, load_station

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

SAMPLED: dict[LayoutName, int] = {
    "random": 6,
    "wide": 5,
    "close": 6,
    "touching": 6,
    "packed": 8,
    "heap": 7,
}
"""Objects of a sampled scene by layout."""


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
    camera = dataclasses.replace(camera, samples=SAMPLES)
    document = dataclasses.replace(station.document, cameras={"portrait": camera})
    station = dataclasses.replace(station, document=document)
    built = build_station_diagram(scene, station, robot=robot, cameras=True)  # type: ignore[arg-type]
    context = built.diagram.CreateDefaultContext()
    pixels = built.diagram.GetOutputPort("camera.portrait.color_image").Eval(context).data
    save(pixels, file)


def save(pixels: np.ndarray, file: str) -> None:
    """Writes an image of Drake's (H, W, 4), in 256 colours to keep it small."""
    image = Image.fromarray(np.ascontiguousarray(pixels[..., :3])).quantize(256)
    IMAGES.mkdir(parents=True, exist_ok=True)
    image.save(IMAGES / file, optimize=True)


BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--disable-background-networking", "--hide-scrollbars"),
    "--virtual-time-budget=12000",
)
SAMPLES = 2
"""Rays along each side of a rendered pixel."""
COLORS = 256
"""Of a screenshot, which makes its PNG a third of the size."""
CONTROLS = "<style>.dg {display: none !important}</style></body>"
"""Hides Meshcat's own button in pages."""


def photograph(page: Path, file: str, size: tuple[int, int]) -> None:
    """Takes a picture of a page.

    Raises:
        SystemExit: there is no browser.
    """
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        raise SystemExit(f"no browser of {', '.join(BROWSERS)} is there to look at pages with")
    head, _, tail = page.read_text().rpartition("</body>")
    page.write_text(head + CONTROLS + tail)
    shot = page.with_suffix(".png")
    arguments = [f"--window-size={size[0]},{size[1]}", f"--screenshot={shot}", page.as_uri()]
    subprocess.run([browser, *OPTIONS, *arguments], check=True, capture_output=True)
    image = Image.open(shot).convert("RGB")
    # without k-means thin lines take the colours of large areas
    few = image.quantize(COLORS, kmeans=16, dither=Image.Dither.NONE)
    IMAGES.mkdir(parents=True, exist_ok=True)
    few.save(IMAGES / file, optimize=True)


def pages() -> None:
    """Writes the pictures of grasps, of a replay, of frames and of a reachability map."""
    with tempfile.TemporaryDirectory() as folder:
        grasps, page = f"{folder}/grasps.h5", Path(folder) / "page.html"
        burg_drake(f"grasps sample tabletop_six -n 30 --diverse 8 -o {grasps}".split())
        run = f"{folder}/run"
        burg_drake(f"evaluate tabletop_six --grasps {grasps} --quiet -o {run}".split())
        best = load_run(run).best()[0]
        burg_drake(f"grasps show {run} --most 30 --select {best} --html {page}".split())
        photograph(page, "grasps.png", (1200, 760))
        burg_drake(f"replay {run} --best --html {page}".split())
        photograph(page, "replay.png", (1000, 700))
        for command in (
            f"grasps score {grasps} --friction 0.6 -o {grasps}",
            f"grasps show {grasps} --color epsilon --html {page}",
        ):
            burg_drake(command.split())
        photograph(page, "grasp_quality.png", (1200, 760))
        burg_drake(["frames", "--html", str(page)])
        photograph(page, "frames.png", (1200, 780))
        show = ["station", "show", "panda_bin", "--scene", "tabletop_six", "--html", str(page)]
        burg_drake(show)
        photograph(page, "reachability.png", (1200, 760))


def report() -> None:
    """Writes the picture of a report: that of the demo with few grasps."""
    with tempfile.TemporaryDirectory() as run:
        evaluate = "evaluate tabletop_six --station panda_tabletop --grasps-per-object 10 --quiet"
        burg_drake([*evaluate.split(), "-o", run])
        photograph(Path(run) / "report.html", "report.png", (985, 1010))


ERROR = 0.002
"""Standard deviation of what stands for a robot's errors, along each axis [m]."""


def trials() -> None:
    """Writes the pictures of trials; grasps that are off by some millimetres stand for a robot."""
    from tools.live_pictures import lab_page

    with tempfile.TemporaryDirectory() as folder:
        simulated, tried, sheet = (Path(folder, name) for name in ("run", "tried", "trials.yaml"))
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 12)
        X_OG = grasps.X_OG.copy()
        X_OG[:, :3, 3] += np.random.default_rng(0).normal(0.0, ERROR, (len(X_OG), 3))
        instances = grasps.column("instance")
        missed = burg.GraspSet.create(X_OG, object=grasps.object, columns={"instance": instances})
        ids = zip(instances, grasps.id, missed.id, strict=True)
        names = {f"{instance}-{id}": f"{instance}-{off}" for instance, id, off in ids}
        settings = burg.EvaluationSettings(engine="screening", mode="hand")
        for out, given in ((simulated, grasps), (tried, missed)):
            burg.evaluate("tabletop_six", "panda_tabletop", out, grasps=given, settings=settings)
        chosen = burg.trials.SelectionSettings(per_object=6)
        planned = burg.trials.plan_trials(simulated, settings=chosen, out=sheet).trials
        book, robot = burg.trials.TrialBook(sheet), load_run(tried)
        ends = [robot.row(names[trial.grasp])["outcome"] for trial in planned]
        for end in ends[:4]:
            book.record("next", outcome=end, operator="Ada")
        lab_page(sheet, IMAGES / "trials_serve.png")
        for end in ends[4:]:
            book.record("next", outcome=end, operator="Ada")
        page = Path(folder, "page.html")
        burg_drake(f"compare {simulated} {sheet} --html {page}".split())
        photograph(page, "compare.png", (985, 1010))


def library() -> None:
    """Writes the picture of the sheet of the built-in objects."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "page.html")
        html = Path(folder, "3d.html")
        burg_drake(f"library show household --sheet {page} --html {html}".split())
        photograph(page, "library.png", (1425, 1370))


def calibration() -> None:
    """Writes the picture of the page of a calibration, from photos that are made by formula."""
    sys.path.insert(0, str(IMAGES.parents[1] / "benchmarks"))
    from room.lens import Camera as Lens
    from room.rows import WEBCAM
    from room.target import target_picture, view_at

    rng = np.random.default_rng(0)
    lens = Lens((640, 480), (600.0, 602.0), (322.0, 236.0), (-0.25, 0.08, 1e-3, -5e-4, 0.0))
    with tempfile.TemporaryDirectory() as folder:
        photos, page = Path(folder, "photos"), Path(folder, "page.html")
        photos.mkdir()
        for number in range(20):
            photo = target_picture(lens, view_at(lens, 1.0, rng), WEBCAM, rng, 0.0)
            Image.fromarray(photo).save(photos / f"{number:02}.png")
        burg_drake(f"camera calibrate {photos} -o {folder}/K.yaml --report {page}".split())
        photograph(page, "calibration.png", (1010, 1010))


def dataset() -> None:
    """Writes the picture of samples of two scenes."""
    with tempfile.TemporaryDirectory() as folder:
        data, sheet = f"{folder}/data", f"{folder}/sheet.png"
        burg_drake(f"dataset generate --sample household:2 --views 1 --quiet -o {data}".split())
        burg_drake(f"dataset show {data} --rows 2 -o {sheet}".split())
        save(np.asarray(Image.open(sheet).convert("RGB")), "dataset.png")


def printout() -> None:
    """Writes the picture of the printed board, on one page; pdftoppm (poppler) has to be there."""
    with tempfile.TemporaryDirectory() as folder:
        board = f"{folder}/board"
        only = "--page A2 --no-instructions"
        burg_drake(f"printout tabletop_six {only} -o {board}.pdf".split())
        to_png = ["pdftoppm", "-png", "-singlefile", "-r", "55", f"{board}.pdf", board]
        subprocess.run(to_png, check=True)
        save(np.asarray(Image.open(f"{board}.png").convert("RGB")), "board.png")


def renderers() -> None:
    """Writes the same scene by Drake's renderer and by Blender, side by side."""
    pictures = [
        burg.render("tabletop_six", "panda_tabletop", "board", ["color"], renderer=renderer).color
        for renderer in ("drake", "blender")
    ]
    image = Image.fromarray(np.hstack([each for each in pictures if each is not None]))
    image.save(IMAGES / "renderers.jpg", quality=85)


def ports() -> None:
    """Runs the example of the ports, and looks at the end of its plan."""
    meshcat = runpy.run_path(str(IMAGES.parents[1] / "examples" / "10_ports.py"))["meshcat"]
    meshcat.SetCameraPose([1.0, -0.75, 0.7], [0.35, 0.0, 0.2])
    for hidden in ("/Grid", "/Axes", "/Background"):
        meshcat.SetProperty(hidden, "visible", False)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(meshcat.StaticHtml())
        photograph(page, "ports.png", (1000, 700))


def station() -> None:
    """Writes the pictures of the station and the built-in objects."""
    panda = load_station("panda_tabletop")
    overview = panda.document.cameras["overview"]
    portrait = dataclasses.replace(overview, width=960, height=720, focal=(1000.0, 1000.0))
    render(load_scene("tabletop_six"), panda, portrait, "arm", "station.png")
    nearer = dataclasses.replace(portrait, focal=(1350.0, 1350.0))
    render(load_scene("tabletop_six"), load_station("panda_wsg"), nearer, "arm", "wsg.png")
    # seen from the front of the board, 40 degrees from above
    X_WC = Pose((-0.31, 0.0, 0.82), rpy_deg=(-134.0, 0.0, -90.0))
    close = Camera(X_WC=X_WC, width=960, height=720, focal=(1150.0, 1150.0))
    render(household(), panda, close, "none", "household.png")


def board() -> None:
    """Writes what the overlay shows while a scene is being built: three objects to be placed."""
    scene, panda = load_scene("tabletop_six"), load_station("panda_tabletop")
    X_WC = Pose((-0.07, -0.48, 0.76), rpy_deg=(-137.0, 0.0, -47.0))
    camera = Camera(X_WC=X_WC, width=960, height=720, focal=(1000.0, 1000.0))
    document = dataclasses.replace(panda.document, cameras={"board": camera})
    loop = build_board_loop(scene, dataclasses.replace(panda, document=document))
    context = loop.diagram.CreateDefaultContext()
    for name, shift in {"mug": (0.02, 0.05), "banana": (-0.06, 0.03), "box": (0.0, 3.0)}.items():
        X_SO = scene.X_SO(name)
        X_SO[:2, 3] += shift
        loop.place_object(context, name, X_SO)
    save(loop.diagram.GetOutputPort("overlay_image").Eval(context).data, "board_loop.png")


MOVED = {
    "mug": (0.006, -0.003, 0.2),
    "banana": (-0.008, 0.012, -0.15),
    "bowl": (4e-4, -3e-4, 0.0),
    "screwdriver": (3e-3, 0.0, 0.0),
}
"""How far objects stand from their places in the picture of the overlay: x, y [m], turn [rad]."""


def overlay() -> None:
    """Writes what the overlay shows after a placement check of a scene that is nearly built."""
    from tools.live_pictures import overlay_page

    scene, panda = load_scene("tabletop_six"), load_station("panda_tabletop")
    X_WC = Pose((-0.03, -0.42, 0.66), rpy_deg=(-137.0, 0.0, -47.0))
    camera = Camera(X_WC=X_WC, width=960, height=640, focal=(1000.0, 1000.0))
    document = dataclasses.replace(panda.document, cameras={"board": camera})
    loop = build_board_loop(scene, dataclasses.replace(panda, document=document))
    context = loop.diagram.CreateDefaultContext()
    for name, (x, y, turn) in MOVED.items():
        X_SO = scene.X_SO(name)
        X_SO[:3, :3] = rot_z(turn) @ X_SO[:3, :3]
        X_SO[:2, 3] += x, y
        loop.place_object(context, name, X_SO)
    pixels = loop.diagram.GetOutputPort("camera.board.color_image").Eval(context).data[..., :3]
    photo = np.ascontiguousarray(pixels)
    check = check_placement(scene, photo, loop.intrinsics)
    assert check.camera is not None, check.reason
    X_SC = check.camera.X_SC.matrix()
    save(Overlay(scene, loop.intrinsics).draw(photo, X_SC, placement=check), "overlay.png")
    with tempfile.TemporaryDirectory() as folder:
        file, intrinsics = Path(folder, "photo.png"), Path(folder, "K.yaml")
        Image.fromarray(photo).save(file)
        save_intrinsics(loop.intrinsics, intrinsics)
        overlay_page(file, intrinsics, IMAGES / "ar.png")


def sampled() -> None:
    """Scenes of each layout, settled, side by side from above at a slant."""
    pictures = []
    library, tabletop = load_library("household"), load_station("panda_tabletop")
    camera = Camera(
        X_WC=Pose((-0.18, 0.0, 0.78), rpy_deg=(-138.0, 0.0, -90.0)),
        width=480,
        height=400,
        focal=(560.0, 560.0),
    )
    for layout, count in SAMPLED.items():
        recipe = SceneRecipe(library="household", count=count, layout=layout, seed=6)
        scene = sample_scene(recipe, library, tabletop).scene
        render(scene, tabletop, camera, "none", "part.png")
        pictures.append(np.asarray(Image.open(IMAGES / "part.png")))
    (IMAGES / "part.png").unlink()
    rows = [np.hstack(pictures[i : i + 3]) for i in (0, 3)]
    save(np.vstack(rows), "sampled.png")


def setup() -> None:
    """Writes the pictures of the setup page, which needs playwright."""
    from tools.setup_pictures import setup

    setup(IMAGES)


def main() -> None:
    """Makes the kinds of pictures that are named, or all."""
    kinds = {
        kind.__name__: kind
        for kind in (
            *(station, board, overlay, pages, report, trials, library, calibration, dataset),
            *(printout, ports, sampled, renderers, setup),
        )
    }
    for name in sys.argv[1:] or kinds:
        if name not in kinds:
            raise SystemExit(f"there are no pictures {name!r}, only {', '.join(kinds)}")
        kinds[name]()


if __name__ == "__main__":
    main()
