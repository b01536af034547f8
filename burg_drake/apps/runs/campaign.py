"""`burg-drake evaluate` on several scenes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import chosen_motion, how_to_retry, read_given, require_standoff_of_arm
from burg_drake.apps.runs.second_opinion import (
    SETTLED_COLUMNS,
    first_engine,
    settle,
    settled_line,
)
from burg_drake.apps.runs.settings import requested_settings
from burg_drake.core import InvalidInputError, listing

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.evaluation.results import Summary
    from burg_drake.evaluation.run import GraspsLike
    from burg_drake.evaluation.store import Campaign
    from burg_drake.evaluation.workers import Executor
    from burg_drake.scene.document import Scene
    from burg_drake.station.document import Station

MAX_SCENE_ROWS = 20
"""Scenes that have a row of their own in the table."""


def evaluate_many(
    arguments: argparse.Namespace, references: Sequence[str], executor: Executor | None = None
) -> int:
    """Evaluates; 1 if scenes could not be judged, or grasps not be simulated.

    Args:
        arguments: of the verb.
        references: the scenes.
        executor: judges in place of processes of this machine.
    """
    from burg_drake.evaluation import evaluate
    from burg_drake.evaluation.records import motion_text
    from burg_drake.evaluation.stages import mode_for
    from burg_drake.station.document import GraspMotion, load_station

    if arguments.output is None:
        raise InvalidInputError(
            f"{len(references)} scenes are given; name a folder for the run with -o RUN"
        )
    station = load_station(arguments.station)
    mode = mode_for(station, arguments.mode)
    require_standoff_of_arm(arguments, mode)
    motion = chosen_motion(arguments, station)
    settings = requested_settings(arguments, mode, motion)
    settings = replace(settings, engine=first_engine(arguments, arguments.output, mode))
    campaign = evaluate(
        list(references),
        station,
        arguments.output,
        settings=settings,
        grasps=_given(arguments, station),
        executor=executor,
        workers=arguments.workers,
        retry_failed=arguments.retry_failed,
        progress=not arguments.quiet,
    )
    campaign = settle(campaign, arguments, executor)
    print_campaign(campaign)
    if arguments.rejudge is not None:
        print(settled_line(campaign.columns(SETTLED_COLUMNS)))
    if motion != GraspMotion():
        print(f"motion  {motion_text(motion)}")
    return campaign_exit_code(campaign)


def print_campaign(campaign: Campaign) -> None:
    """Prints the tables of a run over many scenes, and where what is."""
    from rich.console import Console

    from burg_drake.evaluation.results import summarize, summary_view
    from burg_drake.evaluation.store import PARTS_FOLDER, REPORT_FILE

    summary = summarize(campaign)
    Console().print(summary_view(summary), crop=False)
    _scene_table(summary).show()
    if campaign.document.shard:
        print(f"shard   {campaign.document.shard}; merge all of them with burg-drake merge")
    scenes = f"{campaign.path}/scenes/NAME"
    if any(campaign.folder(name).joinpath(REPORT_FILE).exists() for name in campaign.names):
        print(f"runs    {scenes}, each with a table and a report")
    else:
        print(f"runs    {scenes}, each with a table; burg-drake report {scenes} makes a report")
    print(f"tables  {campaign.path / PARTS_FOLDER} (Parquet, all scenes)")
    if campaign.report_path.exists():
        print(f"report  {campaign.report_path}")


def campaign_exit_code(campaign: Campaign) -> int:
    """Says what could not be judged; the exit code."""
    states = campaign.states.values()
    failed, interrupted = sum(s.failed for s in states), sum(s.interrupted for s in states)
    for name, why in campaign.failed.items():
        print(f"burg-drake: scene {name} could not be judged: {why}", file=sys.stderr)
    if failed:
        where = listing([s.scene for s in states if s.failed])
        print(
            f"burg-drake: {failed} grasps could not be simulated (scenes {where});"
            f" {how_to_retry(interrupted, failed)}",
            file=sys.stderr,
        )
    return 1 if failed or campaign.failed else 0


def _scene_table(summary: Summary) -> Any:
    """The scenes in which the smallest share of the executed grasps was lifted."""
    from burg_drake.core.terminal import TextTable, format_count, format_percent

    def share(group: Any) -> float:
        return group.lifted / group.executed if group.executed else -1.0

    groups = sorted(summary.scenes, key=share)[:MAX_SCENE_ROWS]
    more = len(summary.scenes) - len(groups)
    title = f"Scenes, the {MAX_SCENE_ROWS} with the least success" if more else "Scenes"
    table = TextTable(title).names("scene")
    table.numbers(*summary.steps, "success")
    for group in groups:
        success = format_percent(share(group)) if group.executed else "-"
        table.row(
            group.name, *(format_count(group.funnel[name]) for name in summary.steps), success
        )
    if more:
        table.caption = f"{more:,} more scenes are in the columns of the store"
    return table


def _given(arguments: argparse.Namespace, station: Station) -> GraspsLike | None:
    """The grasps of the file: those in the frames of their objects as a set for all scenes."""
    from burg_drake.apps.options import FRAMES, gripper_for
    from burg_drake.core import content_hash
    from burg_drake.evaluation.grasp_sets import read_input
    from burg_drake.formats.common import read_poses, with_objects_renamed

    if arguments.grasps is None:
        return None
    imported = read_input(
        arguments.grasps,
        arguments.grasps_format,
        gripper_for(arguments, station),
        arguments.correction,
    )
    for note in imported.notes:
        print(f"note: {note}")
    frame = FRAMES.get(arguments.grasps_frame) or imported.frame
    if frame != "object":
        poses = arguments.camera_pose
        placing = [read_poses(poses) if poses else None, sorted(arguments.object_ids.items())]
        content = content_hash(Path(arguments.grasps), arguments.correction, frame, *placing)
        return _FileOfScenes(arguments, station, content, arguments.correction)
    return with_objects_renamed(imported.grasps, dict(arguments.grasps_object))


@dataclass(frozen=True)
class _FileOfScenes:
    """Grasps in the frame of a scene or camera: each scene gets those that a file has of it, by
    the column `scene_id`.

    Attributes:
        arguments: of the verb.
        station: has the hand.
        content: hash of the grasps and of what places them.
        correction: with which they are read.
    """

    arguments: argparse.Namespace
    station: Station
    content: str
    correction: tuple[str, ...]

    def __call__(self, scene: Scene) -> Mapping[str, GraspSet]:
        from burg_drake.core import UnknownNameError
        from burg_drake.evaluation.grasp_sets import NoSceneIdsError

        chosen = argparse.Namespace(**{**vars(self.arguments), "run": None})
        chosen.scene_id = scene.name
        try:
            return read_given(chosen, scene, self.station).by_instance
        except UnknownNameError:
            return {}
        except NoSceneIdsError as error:
            raise InvalidInputError(
                f"{self.arguments.grasps} has grasps in the frame of a scene or camera, without"
                " saying which; evaluate that scene alone"
            ) from error
