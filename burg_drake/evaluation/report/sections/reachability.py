"""Section of the report about what the arm reaches of the board."""

from __future__ import annotations

from burg_drake.core import BurgError
from burg_drake.evaluation.report.elements import Html, element, section
from burg_drake.evaluation.store import Run
from burg_drake.motion.workspace import (
    ReachabilityMap,
    ReachabilitySettings,
    cleared,
    map_reachability,
)
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station
from burg_drake.visualization.pictures import (
    outlines,
    reachability_chart,
    reachability_key,
)

SETTINGS = ReachabilitySettings(spacing=0.043, redundant=(2, 6))
"""Half the points of the default, for a picture."""


def reachability_section(run: Run) -> Html | None:
    """The board without its objects, and where these stand on it; nothing for a run of the hand
    alone, nor if the files that it was judged with are gone or have changed."""
    if run.document.mode == "hand":
        return None
    try:
        scene, station = run.scene(), run.station()
        reachability = _map(cleared(scene), station)
    except BurgError:
        return None
    around = outlines(scene)
    charts = [
        reachability_chart(reachability, height, around)
        for height in range(len(reachability.heights))
    ]
    count = len(reachability.tilt)
    steepest = max(SETTINGS.tilts_deg)
    return section(
        "Reach of the arm",
        f"Share of {count} hand orientations (straight down, and tilted by up to "
        f"{steepest:g}° to all sides) in which the arm reaches each place over the board"
        " without colliding with itself or the station. Outlines show where the objects"
        " stand; they are not obstacles here. Paths to these poses are not checked.",
        element("div", *charts, class_="charts"),
        reachability_key(),
    )


def _map(scene: Scene, station: Station) -> ReachabilityMap:
    """The map of a scene without objects; made once a process for the same contents."""
    key = scene.content, station.content
    if key not in _MAPS:
        _MAPS[key] = map_reachability(scene, station, settings=SETTINGS)
    return _MAPS[key]


_MAPS: dict[tuple[str, str], ReachabilityMap] = {}
