"""`burg-drake grasps show`: the grasps of a run, coloured by what became of them."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import add_verb, add_view, positive_int
from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.outcome import Outcome

if TYPE_CHECKING:
    from burg_drake.evaluation.run_store import Run
    from burg_drake.visualization.page import LegendEntry

DEFAULT_LIMIT = 300


def add_to(group: Any) -> None:
    """Adds the verb."""
    show = add_verb(
        group,
        "show",
        run_show,
        "show the scene of a run with its grasps, coloured by outcome, in Meshcat",
        "burg-drake grasps show runs/first",
        "burg-drake grasps show runs/first --instance mug --outcome lifted,slipped",
        "burg-drake grasps show runs/first --html grasps.html",
    )
    show.add_argument("run_folder", metavar="RUN", help="folder of a run")
    show.add_argument("--instance", metavar="NAME", help="only grasps of this object of the scene")
    show.add_argument(
        "--outcome",
        metavar="A,B",
        type=_outcomes,
        help="only grasps with these outcomes: " + ", ".join(Outcome),
    )
    show.add_argument(
        "--limit",
        metavar="N",
        type=positive_int,
        default=DEFAULT_LIMIT,
        help="at most N grasps of each object, taken evenly (default: %(default)s)",
    )
    add_view(show)


def run_show(arguments: argparse.Namespace) -> int:
    """Shows the judged grasps of a run."""
    import numpy as np

    from burg_drake.apps.live import open_view, present
    from burg_drake.evaluation.run_store import load_run
    from burg_drake.visualization.grasp_view import draw_grasps
    from burg_drake.visualization.scene_view import show_scene

    run = load_run(arguments.run_folder)
    scene, station = run.scene(), run.station()
    chosen = _choose(run, arguments)
    X_WO = {name: station.document.X_WS.matrix() @ scene.X_SO(name) for name in scene.instances}
    candidates = run.candidates
    X_WG = [X_WO[str(candidates.instance[i])] @ candidates.grasps.X_OG[i] for i in chosen]
    verdicts = [run.verdicts.get(candidates.id[i]) for i in chosen]

    meshcat = open_view(arguments)
    show_scene(scene, station, meshcat, robot="none")
    counts = draw_grasps(
        meshcat,
        np.reshape(X_WG, (-1, 4, 4)),
        station.hand,
        [None if v is None else v.outcome for v in verdicts],
        candidates.grasps.width[chosen],
    )
    legend = _legend(counts)
    caption = f"{len(chosen)} of {len(candidates)} grasps"
    _print_legend(legend)
    present(meshcat, arguments, title=f"{scene.name}: grasps", caption=[caption], legend=legend)
    return 0


def _choose(run: Run, arguments: argparse.Namespace) -> list[int]:
    """Indices of the candidates to be drawn."""
    candidates = run.candidates
    instances = dict.fromkeys(candidates.instance.tolist())
    if arguments.instance is not None and arguments.instance not in instances:
        raise UnknownNameError(
            f"{run.path} has no grasps on {arguments.instance!r};"
            f" {nearest(arguments.instance, instances)}"
        )
    chosen: list[int] = []
    for name in [arguments.instance] if arguments.instance is not None else instances:
        members = [i for i, n in enumerate(candidates.instance) if n == name]
        if arguments.outcome is not None:
            members = [i for i in members if _outcome(run, i) in arguments.outcome]
        count = min(len(members), arguments.limit)
        chosen += [members[k * len(members) // count] for k in range(count)]
    if not chosen:
        raise InvalidInputError(f"{run.path} has no such grasps; choose other outcomes")
    return chosen


def _outcome(run: Run, index: int) -> Outcome | None:
    verdict = run.verdicts.get(run.candidates.id[index])
    return None if verdict is None else verdict.outcome


def _legend(counts: Mapping[Outcome | None, int]) -> list[LegendEntry]:
    from burg_drake.visualization.grasp_view import grasp_path
    from burg_drake.visualization.page import LegendEntry
    from burg_drake.visualization.palette import GROUPS, UNJUDGED

    entries = []
    for group in (*GROUPS, UNJUDGED):
        members = [o for o in counts if o in group.outcomes or (o is None and group is UNJUDGED)]
        if members:
            number = sum(counts[o] for o in members)
            paths = tuple(grasp_path(o) for o in members)
            entries.append(LegendEntry(f"{group.name} ({number})", group.hex, paths))
    return entries


def _print_legend(legend: list[LegendEntry]) -> None:
    from rich.console import Console
    from rich.text import Text

    for entry in legend:
        Console().print(Text("■ ", style=entry.color) + Text(entry.label, style="default"))


def _outcomes(text: str) -> set[Outcome]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    known = [outcome.value for outcome in Outcome]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        given = unknown[0] if unknown else text
        raise argparse.ArgumentTypeError(f"{given!r} is no outcome; {nearest(given, known)}")
    return {Outcome(name) for name in names}
