"""`burg-drake grasps label`: labels grasps of the objects of a library, each by itself."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from burg_drake import core, evaluation, formats
from burg_drake.apps import options
from burg_drake.apps.commands.evaluate import (
    SECOND_OPINION_COLUMNS,
    add_rejudge_contested,
    refuse_rejudging_shaken,
    second_opinion_line,
    settling_options,
)
from burg_drake.apps.terminal import print_note_lines, print_remark

if TYPE_CHECKING:
    from burg_drake.station import Engine


def add_grasps_label_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake grasps label`."""
    parser.epilog = options.examples_text(
        "burg-drake grasps label household -n 2000 --to acronym -o labels/",
        "burg-drake grasps label my_library/ --protocol shake --engine mujoco -o shaken/",
        "burg-drake grasps label household -n 2000 --engine mujoco-gpu --to acronym -o labels/",
        "burg-drake grasps label household -o labels/ --rejudge contested --engine reference",
        "burg-drake grasps label my_library/ --grasps Mug_3f2a_0.01.h5 --rename mug -o again/",
        "",
        "The same command continues where an interrupted one stopped.",
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")
    parser.add_argument("library", metavar="LIBRARY", help="library folder, or built-in name")
    options.add_output(parser, "FOLDER", "folder for a file of grasps per object, scenes and runs")
    options.add_format_option(parser, formats.BURG_DRAKE_FORMAT.name)
    source_group = parser.add_mutually_exclusive_group()
    options.add_sampling_options(parser, 100, source_group)
    source_group.add_argument(
        "--grasps",
        metavar="FILE|RUN",
        type=options.input_file,
        help="label the grasps of this file or run, instead of sampling",
    )
    group = parser.add_argument_group("with --grasps")
    options.add_reading_options(group)
    options.add_renaming(group)
    parser.set_defaults(grasp_file_options=[action.dest for action in group._group_actions])
    options.add_station(parser)
    options.add_settings_options(
        parser,
        evaluation.EvaluationSettings,
        *("protocol", "engine", "device"),
    )
    options.add_settings_options(
        parser, evaluation.EvaluationSettings, "tilt_limit_deg", "slip_limit_mm", unset=True
    )
    add_rejudge_contested(parser)
    workers_group = parser.add_mutually_exclusive_group()
    options.add_workers(workers_group)
    options.add_cluster(workers_group)
    options.add_quiet(parser)


def run_grasps_label(arguments: argparse.Namespace) -> int:
    """Labels grasps and writes a file for each object; returns 1 if some were not simulated."""
    options.require_grasp_file(arguments)
    options.refuse_sampling_options_with_file(arguments)
    _refuse_limits_of_shaking(arguments)
    refuse_rejudging_shaken(arguments)
    settings = options.settings_from(
        arguments,
        evaluation.EvaluationSettings,
        grasps_per_object=options.grasps_per_object(arguments),
        only=arguments.only,
        engine=_first_engine(arguments),
    )
    target = arguments.target or formats.BURG_DRAKE_FORMAT.name
    output = options.grasp_output(f"{arguments.output}/", target, frame="object")
    grasps = _given_grasps(arguments, output)
    labelled = []
    with options.cluster_from_options(arguments) as executor:
        label = partial(
            evaluation.label_library,
            arguments.library,
            arguments.station,
            arguments.output,
            format=output.format.name,
            grasps=grasps,
            settings=settings,
            executor=executor,
            workers=arguments.workers,
            progress=not arguments.quiet,
        )
        if arguments.rejudge is not None:
            _settle_contested(list(label()), arguments, executor)
        for found in label():
            if found.path is not None:
                of_format = options.format_title(output.format)
                count = core.count_with_noun(len(found.success), "labelled grasp")
                print(f"wrote {count} to {found.path} as {of_format}")
            labelled.append(found)
    _print_labels(labelled, rejudged=arguments.rejudge is not None)
    return _report_failures(labelled, arguments.output)


def _print_labels(labelled: Sequence[evaluation.ObjectLabels], *, rejudged: bool) -> None:
    """Prints the table of labels, notes, and how many labels are settled or contested."""
    labels_table(labelled).show()
    of_runs = (note for found in labelled if found.run for note in evaluation.run_notes(found.run))
    print_note_lines(dict.fromkeys((*of_runs, *(n for found in labelled for n in found.notes))))
    runs = [found.run for found in labelled if found.run]
    if rejudged and runs:
        print(second_opinion_line(_joined_columns(runs)))
    _print_contested(runs)


def _settle_contested(
    labelled: Iterable[evaluation.ObjectLabels],
    arguments: argparse.Namespace,
    executor: evaluation.Executor | None,
) -> None:
    """Judges the contested grasps of all objects again with the preset of --engine."""
    for found in labelled:
        if found.run and found.run.contested:
            evaluation.judge_again(
                found.run,
                engine=arguments.engine,
                executor=executor,
                workers=arguments.workers,
                progress=not arguments.quiet,
            )


def _first_engine(arguments: argparse.Namespace) -> Engine | str:
    """The engine that labels all grasps; with --rejudge that of the runs in the folder, or the
    standard one for a new folder.

    Raises:
        InvalidInputError, UnknownNameError: see `require_second_engine`.
    """
    from burg_drake.station import DEFAULT_ENGINE, ENGINES

    if arguments.rejudge is None:
        return str(arguments.engine)
    runs = Path(arguments.output) / evaluation.LABELLING_RUNS_FOLDER
    begun = sorted(runs.glob(f"*/{evaluation.RUN_FILE}"))
    first = ENGINES[DEFAULT_ENGINE]
    if begun:
        first = evaluation.load_run(begun[0].parent).document.engine
    evaluation.require_second_engine(arguments.engine, first, "hand")
    return first


def _joined_columns(runs: Sequence[evaluation.Run]) -> evaluation.Columns:
    """The columns of all runs that `second_opinion_line` reads."""
    columns = [run.columns(SECOND_OPINION_COLUMNS) for run in runs]
    return {name: np.concatenate([c[name] for c in columns]) for name in SECOND_OPINION_COLUMNS}


def _print_contested(runs: Sequence[evaluation.Run]) -> None:
    """Prints how many labels are contested, by object, and how to settle them."""
    contested = {run.document.scene.name: len(run.contested) for run in runs}
    if not sum(contested.values()):
        return
    count = core.count_with_noun(sum(contested.values()), "label")
    by_object = core.list_names([f"{name} {n}" for name, n in contested.items() if n])
    print(
        f"contested: {count} ({by_object}); settle them by the same command with"
        f" {settling_options(runs[0])}"
    )


def _report_failures(labelled: Sequence[evaluation.ObjectLabels], folder: str) -> int:
    """Prints what could not be evaluated; returns the exit code."""
    max_objects = 5  # Objects whose error is printed.
    refused = [found for found in labelled if found.error]
    for found in refused[:max_objects]:
        print_remark(f"{found.object}: {found.error}")
    if len(refused) > max_objects:
        names = core.list_names([found.object for found in refused[max_objects:]])
        print_remark(f"{names}: likewise not evaluated; --only shows why")
    failures = sum(len(found.run.failures) for found in labelled if found.run)
    if failures:
        print_remark(
            f"{failures} grasps could not be simulated and have no label; the tables of results"
            f" below {Path(folder) / evaluation.LABELLING_RUNS_FOLDER} have the reasons"
        )
    return 1 if failures or refused else 0


def _refuse_limits_of_shaking(arguments: argparse.Namespace) -> None:
    """Refuses options that have no effect where the hand is shaken."""
    for name in ("approach_angle", "tilt_limit", "slip_limit_mm"):
        if arguments.protocol == "shake" and getattr(arguments, name) is not None:
            raise core.InvalidInputError(
                f"{arguments.flags[name]} has no effect with --protocol shake: grasps come from all"
                " sides, and an object may move in the hand; leave it out"
            )


def _given_grasps(
    arguments: argparse.Namespace, output: options.GraspOutput
) -> core.GraspSet | None:
    """The grasps of --grasps with their objects renamed; their labels do not replace them."""
    from burg_drake.formats import with_objects_renamed

    if arguments.grasps is None:
        return None
    gripper = options.gripper_from_options(
        arguments, options.station_from_options(arguments, arguments.grasps)
    )
    imported = evaluation.read_input(
        arguments.grasps, arguments.source, gripper, arguments.correction
    )
    if imported.frame != "object":
        raise core.InvalidInputError(
            f"{arguments.grasps} has grasps in the {imported.frame} frame; bring them into those"
            " of the objects with `burg-drake grasps convert`"
        )
    print_note_lines(imported.notes)
    grasps = with_objects_renamed(imported.grasps, dict(arguments.rename))
    _refuse_replaced_input(arguments.grasps, grasps, output)
    return grasps


def _refuse_replaced_input(source: str, grasps: core.GraspSet, output: options.GraspOutput) -> None:
    """Refuses to write labels over the file that the grasps come from."""
    suffix = output.format.suffixes[0]
    files = {(output.path / f"{name}{suffix}").resolve() for name in set(grasps.object.tolist())}
    if Path(source).resolve() in files:
        raise core.InvalidInputError(
            f"the labels would replace {source}, from which the grasps come (--grasps); choose"
            " another folder (-o)"
        )


def labels_table(labelled: Sequence[evaluation.ObjectLabels]) -> core.TextTable:
    """Table of labelled grasps by object; with the agreement where they came with labels."""
    has_given = any(np.isfinite(found.given).any() for found in labelled)
    table = core.TextTable().names("object").numbers("grasps", "success", "share")
    if has_given:
        table.numbers("label as given")
    for found in labelled:
        known = np.isfinite(found.success)
        success = int(found.success[known].sum())
        share = core.format_percent(success / known.sum()) if known.any() else "-"
        cells = [*map(core.format_count, (len(known), success)), share]
        if has_given:
            compared = known & np.isfinite(found.given)
            agree = found.success[compared] == found.given[compared]
            cells.append(f"{int(agree.sum())} of {len(agree)}" if len(agree) else "-")
        table.row(found.object, *cells)
    return table
