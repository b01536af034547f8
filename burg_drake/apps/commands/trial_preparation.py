"""`burg-drake trials plan`, `sheet` and `export`: choice of grasps, paper form, robot motions."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import get_args

from burg_drake import core, experiment
from burg_drake.apps import options
from burg_drake.apps.commands.trial_records import (
    add_moved_run_option,
    add_show_simulated_option,
    add_trials_argument,
)
from burg_drake.apps.terminal import print_note_lines, print_remark, print_warning


def add_trials_plan_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials plan`."""
    parser.epilog = options.examples_text(
        "burg-drake trials plan runs/first --per-object 10 -o trials.yaml",
        "burg-drake trials plan runs/many --scenes 5 --balance margin:clearance -o t.yaml",
        "burg-drake trials plan runs/a runs/b --balance stage --among clear --seed 7 -o t.yaml",
        "",
        "A grasp that several runs evaluated is tried once.",
    )
    parser.add_argument("runs", metavar="RUN", nargs="+", help="folder of a run")
    choice = ("per_object", "balance", "bins", "among", "success", "scenes", "blocks")
    options.add_settings_options(parser, experiment.SelectionSettings, *choice)
    parser.add_argument(
        "--robustness",
        metavar="TABLE",
        help="table of robustness (default: robustness.csv in the run's folder)",
    )
    options.add_settings_options(parser, experiment.SelectionSettings, "seed")
    options.add_output(parser, "FILE", "trials file to write (.yaml)")


def run_trials_plan(arguments: argparse.Namespace) -> int:
    """Chooses grasps for trials, writes them, and prints the choice and its expected precision."""
    core.require_writable(arguments.output)
    sheet = experiment.plan_trials(
        arguments.runs,
        settings=options.settings_from(arguments, experiment.SelectionSettings),
        robustness=arguments.robustness,
        out=arguments.output,
    )
    _print_choice(sheet)
    experiment.power_table(sheet).show()
    print(experiment.detectable_difference_sentence(len(sheet.trials)))
    print_note_lines(sheet.notes)
    print(f"wrote {len(sheet.trials)} trials to {arguments.output}")
    return 0


def _print_choice(sheet: experiment.TrialSheet) -> None:
    """Prints the number of chosen grasps by object and stratum, summed over the runs."""
    chosen: Counter[tuple[str, str]] = Counter()
    available: Counter[tuple[str, str]] = Counter()
    for stratum in sheet.strata.values():
        chosen[stratum.object, stratum.label] += stratum.selected
        available[stratum.object, stratum.label] += stratum.population
    table = core.TextTable("Chosen for the robot").names("object").texts("stratum")
    table.numbers("chosen", "there are")
    for object_name, label in sorted(available):
        counts = (chosen[object_name, label], available[object_name, label])
        table.row(object_name, label, *map(str, counts))
    table.row("all", "", str(chosen.total()), str(available.total()), bold=True)
    table.show()


def add_trials_sheet_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials sheet`."""
    parser.epilog = options.examples_text(
        "burg-drake trials sheet trials.yaml -o sheet.html",
        "burg-drake trials sheet trials.yaml -o sheet.html --show-simulated",
        "",
        "Print the page on A4 or letter. The board of each scene lies beside it, as"
        " sheet_SCENE.pdf.",
    )
    add_trials_argument(parser)
    add_moved_run_option(parser)
    options.add_output(parser, "FILE", "page to write (.html)")
    add_show_simulated_option(parser)
    parser.add_argument(
        "--no-printouts", action="store_true", help="do not write the boards to print"
    )


def run_trials_sheet(arguments: argparse.Namespace) -> int:
    """Writes the protocol, and the printed boards."""
    core.require_writable(arguments.output)
    runs = experiment.TriedRuns(arguments.trials, dict(arguments.moved))
    page = Path(arguments.output)
    printouts = {} if arguments.no_printouts else _write_printouts(runs, page)
    layout = experiment.ProtocolOptions(
        show_simulated=arguments.show_simulated, printouts=printouts
    )
    core.atomic_write(page, experiment.protocol_page(runs, experiment.TrialPictures(runs), layout))
    print(f"wrote {page}: {len(runs.sheet.trials)} trials")
    return 0


def _write_printouts(runs: experiment.TriedRuns, page: Path) -> dict[int, str]:
    """Writes the board of each scene; returns the files' names by block."""
    from burg_drake.printout import PrintSettings, print_board

    names: dict[int, str] = {}
    written: dict[str, str] = {}
    for block, trials in experiment.trials_by_block(runs.sheet).items():
        scene = runs.of(trials[0]).scene
        if scene.content not in written:
            taken = f"_{block}" if f"{page.stem}_{scene.name}.pdf" in written.values() else ""
            name = f"{page.stem}_{scene.name}{taken}.pdf"
            try:
                print_board(scene, PrintSettings(instructions=True)).save(page.with_name(name))
            except core.BurgError as error:
                print_warning(f"no printed board of {scene.name}: {error}")
                continue
            written[scene.content] = name
            print(f"wrote {page.with_name(name)}")
        names[block] = written[scene.content]
    return names


def add_trials_export_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials export`."""
    from burg_drake.evaluation import PlanFormat

    parser.epilog = options.examples_text(
        "burg-drake trials export trials.yaml -o plans/",
        "burg-drake trials export trials.yaml -o plans/ --format csv --station my_cell.yaml",
        "",
        "The file index.csv lists all trials and what stops the arm. The same command continues"
        " where an interrupted one stopped. Exit code 1 if a trial could not be planned.",
    )
    add_trials_argument(parser)
    options.add_output(parser, "DIR", "folder to write, 1.5 MB per motion")
    parser.add_argument(
        "--format",
        choices=get_args(PlanFormat),
        default="json",
        help="JSON like ROS's JointTrajectory, or CSV tables (default: %(default)s)",
    )
    options.add_station(parser, "station with the arm (default: that of each run)", default=None)
    add_moved_run_option(parser)
    options.add_workers(parser)
    options.add_retry_failed(parser, "trials")
    options.add_quiet(parser)
    parser.set_defaults(after_interrupt="; run the same command to continue")


def run_trials_export(arguments: argparse.Namespace) -> int:
    """Plans and writes robot motions; returns 1 if a trial could not be judged."""
    rows = experiment.export_trials(
        arguments.trials,
        arguments.output,
        format=arguments.format,
        station=arguments.station,
        moved=dict(arguments.moved),
        retry_failed=arguments.retry_failed,
        workers=arguments.workers,
        progress=not arguments.quiet,
    )
    _print_unplanned_trials(rows)
    written = sum(bool(row.file) for row in rows)
    print(
        f"{written} of {len(rows)} motions are in {arguments.output}, listed in"
        f" {experiment.MOTION_INDEX_FILE}"
    )
    failed = [row for row in rows if row.reason and not row.file]
    if failed:
        first = failed[0]
        print_remark(
            f"{len(failed)} trials have no motion because a computation failed, such"
            f" as {first.number}: {core.shorten_text(first.reason, 200)}"
        )
    return 1 if failed else 0


def _print_unplanned_trials(rows: list[experiment.ExportedMotion]) -> None:
    """Prints the trials that the arm cannot execute, and why."""
    hindered = [row for row in rows if not row.file and not row.reason]
    if not hindered:
        return
    table = core.TextTable("The arm cannot execute").numbers("trial").texts("grasp", "because of")
    for row in hindered:
        table.row(str(row.number), row.grasp, f"{row.answer} {row.blocker}".strip())
    counts = Counter(row.answer for row in hindered)
    text = ", ".join(f"{count} {answer}" for answer, count in counts.most_common())
    table.caption = f"{text}; record them as such, or plan with --among reachable or executed"
    table.show()
