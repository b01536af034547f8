"""`burg-drake benchmark`: suites, runs of planners on them, and their comparison."""

from __future__ import annotations

import argparse
import shlex
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import benchmark, core, evaluation
from burg_drake.apps import options
from burg_drake.apps.commands import replay
from burg_drake.apps.terminal import print_note_lines, print_remark, show_progress

if TYPE_CHECKING:
    from burg_drake.experiment import TrialSheet
    from burg_drake.scene import Scene
    from burg_drake.station import Station


def add_benchmark_list_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark list`."""
    parser.epilog = options.examples_text("burg-drake benchmark list")


def run_benchmark_list(arguments: argparse.Namespace) -> int:
    """Prints the built-in suites."""
    table = core.TextTable("Built-in suites").names("suite")
    table.numbers("release", "scenes", "objects", "grasps").texts("station", "what it has")
    for name in benchmark.suite_names():
        suite = benchmark.load_suite(name)
        document = suite.document
        counts = [len(scene.instances) for scene in suite.scenes().values()]
        table.row(
            name,
            str(document.release),
            str(len(counts)),
            f"{min(counts)}-{max(counts)}" if min(counts) < max(counts) else str(counts[0]),
            str(document.budget.grasps),
            suite.station.name,
            document.description,
        )
    table.caption = (
        "objects: in a scene\ngrasps: judged of each answer\n"
        "benchmark show SUITE prints the scenes, and writes them with their boards"
    )
    table.show()
    return 0


def add_benchmark_show_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark show`."""
    parser.epilog = options.examples_text(
        "burg-drake benchmark show tabletop",
        "burg-drake benchmark show tabletop --scenes tabletop/",
    )
    _add_suite(parser)
    parser.add_argument(
        "--scenes",
        metavar="FOLDER",
        help="also write each scene as YAML, its board as PDF, and what the camera sees as PNG",
    )
    options.add_quiet(parser)


def run_benchmark_show(arguments: argparse.Namespace) -> int:
    """Prints a suite; writes its scenes if asked for."""
    suite = benchmark.load_suite(arguments.suite)
    document = suite.document
    description = f": {document.description}" if document.description else ""
    print(f"{suite.name}, release {document.release}{description}")
    print(f"hash      {suite.hash}")
    print(f"library   {suite.library.root}")
    print(f"station   {suite.station.path}")
    for camera in document.cameras:
        image = camera.scene_camera().intrinsics
        noise = "with its noise" if camera.noise else "without noise"
        print(f"camera    {camera.name}: {camera.sensor}, {image.width} x {image.height}, {noise}")
    budget = document.budget
    print(f"budget    {budget.grasps} grasps and {budget.seconds:g} s for each image")
    print(f"judged    mode {document.mode}, engine {document.engine}")
    table = core.TextTable("Scenes").names("scene").texts("split").numbers("objects").texts("which")
    for one in document.scenes:
        counts = Counter(instance.object for instance in one.instances)
        names = ", ".join(name if n == 1 else f"{n} x {name}" for name, n in counts.items())
        table.row(one.name, one.split, str(len(one.instances)), names)
    table.show()
    if arguments.scenes is not None:
        _write_scenes(suite, Path(arguments.scenes), quiet=arguments.quiet)
    return 0


def _write_scenes(suite: benchmark.Suite, folder: Path, *, quiet: bool) -> None:
    """Writes scenes, boards and pictures of a suite."""
    scenes = {**suite.scenes("test"), **suite.scenes("tuning")}
    with show_progress("writing", "scenes", len(scenes), quiet=quiet) as meter:
        for scene in scenes.values():
            benchmark.write_suite_scene(suite, scene, folder)
            meter.step()
    print(f"wrote     {folder}: for each scene .yaml, .pdf (print at 100 %) and .png")


def add_benchmark_run_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark run`."""
    parser.epilog = options.examples_text(
        "burg-drake benchmark run tabletop --planner antipodal -o results/antipodal",
        "burg-drake benchmark run tabletop --planner my_method:plan -o results/mine",
        "burg-drake benchmark run tabletop --planner ws://127.0.0.1:9000 -o results/network",
        "burg-drake benchmark run packed --planner antipodal --protocol clear -o results/clear",
        "burg-drake benchmark run my_suite.yaml --planner random -o results/random --settle"
        " reference",
        "burg-drake benchmark run tabletop --planner antipodal --images photos/ -o results/real",
        "",
        "The same command continues where an interrupted one stopped.",
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")
    _add_suite(parser)
    parser.add_argument(
        "--planner",
        required=True,
        metavar="PLANNER",
        help="built-in planner, MODULE:FUNCTION, ws://HOST:PORT or command:LINE (see `planner"
        " list`)",
    )
    options.add_output(parser, "RESULT", "folder of the result")
    options.add_settings_options(
        parser,
        benchmark.BenchmarkSettings,
        *("name", "protocol", "split", "depth_only", "settle"),
    )
    group = parser.add_argument_group(
        "images of a real camera", "In place of rendered ones; see the tutorial."
    )
    group.add_argument(
        "--images",
        metavar="FOLDER",
        help="for each scene SCENE.png and SCENE.depth.png or .npy; intrinsics.yaml; camera.yaml,"
        " unless the board is in view",
    )
    options.add_depth_unit(group)
    group = parser.add_argument_group(
        "robustness", "Change one at a time; `compare` shows what it costs."
    )
    options.add_settings_options(
        group,
        benchmark.Conditions,
        *("depth_noise", "camera_shift", "camera_turn", "friction"),
    )
    workers_group = parser.add_mutually_exclusive_group()
    options.add_workers(workers_group)
    options.add_cluster(workers_group)
    options.add_quiet(parser)


def run_benchmark_run(arguments: argparse.Namespace) -> int:
    """Benchmarks a planner; returns 1 if scenes could not be judged, or no answer has grasps."""
    if arguments.depth_unit is not None and arguments.images is None:
        raise core.InvalidInputError("--depth-unit is for --images; add it")
    core.resolve_reference(arguments.suite, benchmark.SUITE_FOLDER)  # a wrong name is told at once
    with options.cluster_from_options(arguments) as executor:
        result = benchmark.run_benchmark(
            arguments.suite,
            arguments.planner,
            arguments.output,
            settings=options.settings_from(
                arguments,
                benchmark.BenchmarkSettings,
                conditions=options.settings_from(arguments, benchmark.Conditions),
                depth_unit=arguments.depth_unit,
            ),
            images=arguments.images,
            workers=arguments.workers,
            executor=executor,
            progress=not arguments.quiet,
        )
    _print_tables(benchmark.compare_by_suite([result]))
    times = result.document.times
    seeing = "reading" if arguments.images else "rendering"
    print(
        f"time      {core.format_duration(times.total)}: {seeing}"
        f" {core.format_duration(times.rendering)}, planner {core.format_duration(times.planning)},"
        f" trials {core.format_duration(times.judging)}"
    )
    print(f"result    {result.path}")
    campaign = result.rounds[0].campaign
    if campaign is not None:
        print(f"report    {campaign.report_path}")
    return _report_failures(result)


def _report_failures(result: benchmark.BenchmarkResult) -> int:
    """Prints failed answers and scenes; returns the exit code."""
    max_lines = 5  # Failed answers, and kinds of notes, that are printed.
    answers = [one.answer for round in result.rounds for one in result.judged_answers(round)]
    failed: dict[str, list[str]] = {}
    for one in answers:
        if one.error:
            failed.setdefault(one.error, []).append(one.scene)
    for text, scenes in list(failed.items())[:max_lines]:
        where = scenes[0] if len(scenes) == 1 else f"{len(scenes)} images, such as {scenes[0]}"
        print_remark(f"{where}: {text}")
    if len(failed) > max_lines:
        print_remark(f"and {len(failed) - max_lines} other errors of the planner")
    if failed and result.document.images:
        print_remark("images of a camera have no segmentation, which rendered ones have")
    elif failed:
        planner = shlex.quote(result.document.planner)
        print_remark(f"to try the planner alone: burg-drake planner check {planner}")
    notes = Counter(note for one in answers for note in one.notes)
    print_note_lines(f"{note} ({n} images)" for note, n in notes.most_common(max_lines))
    campaigns = [round.campaign for round in result.rounds]
    unjudged = {name: why for one in campaigns if one for name, why in one.failed.items()}
    for name, why in unjudged.items():
        print_remark(f"scene {name} could not be judged: {why}")
    if not any(one.answered for one in answers):
        print_remark("no answer has grasps")
        return 1
    return 1 if unjudged else 0


def add_benchmark_trials_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark trials`."""
    parser.epilog = options.examples_text(
        "burg-drake benchmark trials results/mine_real results/other_real -o trials.yaml",
        "",
        "The methods' grasps are in random order. `burg-drake trials` has the sheet, the page for"
        " the lab and the motions; `burg-drake benchmark compare --trials` the result.",
    )
    _add_results(parser)
    options.add_output(parser, "FILE", "trials file to write (.yaml)")
    parser.add_argument(
        "--seed", type=options.seed, default=0, help="seed of the order (default: %(default)d)"
    )


def run_benchmark_trials(arguments: argparse.Namespace) -> int:
    """Plans trials of the best grasps on a robot."""
    results = list(map(benchmark.load_result, arguments.results))
    sheet = benchmark.plan_robot_trials(results, arguments.output, seed=arguments.seed)
    print_note_lines(sheet.notes)
    count = core.count_with_noun(len(sheet.trials), "trial")
    scenes = len({run.scene.content for run in sheet.runs.values()})
    print(f"wrote {arguments.output}: {count} on {core.count_with_noun(scenes, 'scene')}")
    left_out = sum(answer.executed != 0 for result in results for answer in result.answers)
    if left_out:
        print(
            f"{core.count_with_noun(left_out, 'image')} without a grasp, or whose best one is out"
            " of reach or collides, will count as failures"
        )
    return 0


def add_benchmark_compare_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark compare`."""
    parser.epilog = options.examples_text(
        "burg-drake benchmark compare results/*",
        "burg-drake benchmark compare results/* --html leaderboard.html",
        "burg-drake benchmark compare results/* --trials trials.yaml",
    )
    _add_results(parser)
    _add_trials(parser)
    parser.add_argument("--html", metavar="PAGE", help="write a leaderboard as a page (.html)")
    parser.add_argument(
        "--replays",
        metavar="N",
        type=options.positive_int,
        default=0,
        help="with --html, simulate N failures of each method again, and show them in 3D",
    )
    options.add_quiet(parser)


def run_benchmark_compare(arguments: argparse.Namespace) -> int:
    """Prints and writes the comparison of results."""
    if arguments.replays and arguments.html is None:
        raise core.InvalidInputError("--replays is for --html; add it")
    comparisons = benchmark.compare_by_suite(_complete_results(arguments.results))
    sheets = _load_sheets(arguments)
    _print_tables(comparisons, sheets)
    if arguments.html is not None:
        page = Path(arguments.html)
        extras = benchmark.LeaderboardExtras(
            sheets=sheets,
            replays=_write_replays(comparisons, page, arguments),
            pictures=_scene_pictures(comparisons, quiet=arguments.quiet),
        )
        benchmark.write_leaderboard(comparisons, page, extras=extras)
        print(f"wrote {page}")
        if extras.replays:
            folders = {str(replay.parent) for replay in extras.replays.values()}
            print(f"wrote {', '.join(sorted(folders))}: replays that the page opens")
    return 0


def _write_replays(
    comparisons: Sequence[benchmark.MethodComparison], page: Path, arguments: argparse.Namespace
) -> dict[tuple[Path, str], Path]:
    """Writes pages of failures beside the leaderboard, unless they are there. What cannot be
    replayed is left out, with a remark."""
    failures = benchmark.failed_grasps(comparisons, arguments.replays)
    folder = page.parent / f"{page.stem}_replays"
    found: dict[tuple[Path, str], Path] = {}
    problems: Counter[str] = Counter()
    with show_progress("replaying", "grasps", len(failures), quiet=arguments.quiet) as meter:
        for run, id in failures:
            hash = evaluation.load_run(run).document.hash[:12]
            file = folder / f"{run.name}_{hash}_{id}.html"
            try:
                if not file.exists():
                    replay.save_replay(run, id, core.ensure_writable_folder(folder) / file.name)
                found[run, id] = file
            except core.BurgError as error:
                problems[str(error)] += 1
            meter.step()
    for text, count in problems.items():
        print_remark(f"{core.count_with_noun(count, 'grasp')} cannot be replayed: {text}")
    return found


def _scene_pictures(
    comparisons: Sequence[benchmark.MethodComparison], *, quiet: bool
) -> dict[tuple[str, str], bytes]:
    """Pictures of the scenes; none, with a remark, if they cannot be rendered."""
    try:
        return benchmark.scene_pictures(comparisons, progress=not quiet)
    except core.BurgError as error:
        print_remark(f"the page has no pictures of the scenes: {error}")
        return {}


def add_benchmark_table_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark table`."""
    parser.epilog = options.examples_text("burg-drake benchmark table results/* --markdown")
    _add_results(parser)
    _add_trials(parser)
    parser.add_argument("--markdown", action="store_true", help="print GitHub's Markdown")


def run_benchmark_table(arguments: argparse.Namespace) -> int:
    """Prints the tables of results."""
    comparisons = benchmark.compare_by_suite(_complete_results(arguments.results))
    sheets = _load_sheets(arguments)
    if not arguments.markdown:
        _print_tables(comparisons, sheets)
        return 0
    for table in benchmark.all_tables(comparisons, sheets):
        print(table.markdown())
    return 0


def add_benchmark_verify_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark verify`."""
    parser.epilog = options.examples_text(
        "burg-drake benchmark verify results/antipodal",
        "burg-drake benchmark verify results/antipodal -n 200 --seed 3",
    )
    parser.add_argument("result", metavar="RESULT", help="folder that `benchmark run` wrote")
    parser.add_argument(
        "-n",
        dest="count",
        metavar="N",
        type=options.positive_int,
        default=benchmark.VERIFIED_GRASPS,
        help="number of grasps to judge again (default: %(default)d)",
    )
    parser.add_argument(
        "--seed", type=options.seed, default=0, help="seed of the choice (default: %(default)d)"
    )
    options.add_workers(parser)
    options.add_quiet(parser)


def run_benchmark_verify(arguments: argparse.Namespace) -> int:
    """Judges a sample of a result again; returns 1 if something differs."""
    found = benchmark.verify_result(
        arguments.result,
        count=arguments.count,
        seed=arguments.seed,
        workers=arguments.workers,
        progress=not arguments.quiet,
    )
    print_note_lines(found.notes)
    for grasp in found.differing:
        print("\n    ".join([f"{grasp.run} {grasp.id}", *grasp.text]))
    same = len(found.grasps) - len(found.differing)
    print(f"{same} of {core.count_with_noun(len(found.grasps), 'grasp')} judged again as recorded")
    return 1 if found.differing else 0


def add_benchmark_new_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake benchmark new`."""
    parser.epilog = options.examples_text(
        "burg-drake benchmark new my_suite.yaml --scenes scenes/",
        "burg-drake benchmark new my_suite.yaml --sample my_library:50 -n 6 --spacing close",
        "burg-drake benchmark new bin.yaml --sample household:20 --heap --station panda_bin",
        "",
        "The suite records the content of its objects and station; it is refused when they change.",
    )
    parser.add_argument("suite", metavar="SUITE", help="file to write (.yaml)")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--sample", metavar="LIBRARY:N", type=_library_and_count, help="sample N scenes"
    )
    source.add_argument("--scenes", metavar="SCENE", nargs="+", help="scene files or folders")
    parser.add_argument(
        "--description", metavar="TEXT", default="", help="what the suite has, in one sentence"
    )
    options.add_settings_options(parser, benchmark.Budget, "grasps", "seconds", "picks")
    group = parser.add_argument_group("camera")
    options.add_settings_options(
        group,
        benchmark.CameraPlacement,
        *("sensor", "distance", "elevation_deg", "azimuth_deg", "exact_depth"),
    )
    parser.add_argument(
        "--mode",
        choices=core.MODES,
        help="how grasps are judged, as in `evaluate` (default: reach, or hand without an arm)",
    )
    parser.add_argument(
        "--tuning-scenes",
        metavar="N",
        type=int,
        default=0,
        help="the last N scenes are for tuning and do not count (default: %(default)d)",
    )
    options.add_recipe_options(parser, with_count=False)
    options.add_quiet(parser)


def run_benchmark_new(arguments: argparse.Namespace) -> int:
    """Writes a suite of given or sampled scenes."""
    from burg_drake.scene import load_scene, scene_references
    from burg_drake.station import load_station

    if Path(arguments.suite).exists():
        raise core.InvalidInputError(
            f"{arguments.suite} exists already; choose another name, or delete it: interrupted"
            " results of a suite cannot be continued on another one"
        )
    station = load_station(arguments.station)
    if arguments.sample is None:
        scenes = [load_scene(reference) for reference in scene_references(arguments.scenes)]
    else:
        scenes = _sample_scenes(arguments, station)
    placement = options.settings_from(arguments, benchmark.CameraPlacement)
    suite = benchmark.make_suite(
        arguments.suite,
        scenes,
        cameras=[placement.camera(scenes[0].board)],
        station=station,
        settings=benchmark.SuiteSettings(
            description=arguments.description,
            budget=options.settings_from(arguments, benchmark.Budget),
            mode=arguments.mode,
            tuning=arguments.tuning_scenes,
        ),
    )
    print(f"wrote {suite.path}: {core.count_with_noun(len(scenes), 'scene')}, hash {suite.hash}")
    return 0


def _sample_scenes(arguments: argparse.Namespace, station: Station) -> list[Scene]:
    """Samples the scenes of a suite.

    Raises:
        InvalidInputError: fewer scenes than asked for were accepted.
    """
    from burg_drake import generation
    from burg_drake.objects import load_library
    from burg_drake.scene import load_scene

    name, count = arguments.sample
    library = load_library(name)
    with (
        tempfile.TemporaryDirectory() as folder,
        show_progress("sampling", "scenes", count, quiet=arguments.quiet) as meter,
    ):
        chosen = argparse.Namespace(**{**vars(arguments), "library": name})
        recipe = options.recipe_from_options(chosen, library, station, Path(folder))
        found = generation.sample_scenes(
            *(recipe, library, station, folder, count),
            workers=arguments.workers,
            progress=lambda _: meter.step(),
        )
        accepted = [number for number, row in found.rows.items() if row.accepted]
        if len(accepted) < count:
            raise core.InvalidInputError(
                f"only {len(accepted)} of {count} scenes were accepted; ask for fewer objects, a"
                " larger board or more --attempts"
            )
        return [load_scene(Path(folder, f"scene_{number:04d}.yaml")) for number in accepted]


def _library_and_count(text: str) -> tuple[str, int]:
    library, colon, count = text.rpartition(":")
    if not colon or not library or not count.isdigit() or int(count) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not LIBRARY:N, such as household:50")
    return library, int(count)


def _add_suite(parser: Any) -> None:
    parser.add_argument(
        "suite",
        metavar="SUITE",
        help=f"suite file, or built-in: {', '.join(core.builtin_names(benchmark.SUITE_FOLDER))}",
    )


def _add_results(parser: Any) -> None:
    parser.add_argument(
        "results", metavar="RESULT", nargs="+", help="folder that `benchmark run` wrote"
    )


def _complete_results(folders: Sequence[str]) -> list[benchmark.BenchmarkResult]:
    """Results in folders, without those that were interrupted, which are named."""
    given = {Path(folder).resolve(): folder for folder in folders}
    results = [benchmark.load_result(folder) for folder in given.values()]
    complete = [result for result in results if result.document.complete]
    if not complete and results:
        results[0].require_complete()
    for result in results:
        if result not in complete:
            print_remark(
                f"{result.path} is left out, as it is not complete; finish it with:"
                f" {result.document.command}"
            )
    print_note_lines(benchmark.version_notes(complete))
    return complete


def _add_trials(parser: Any) -> None:
    parser.add_argument(
        "--trials",
        metavar="FILE",
        nargs="+",
        default=[],
        help="trials files of `benchmark trials`, to compare with the robot",
    )


def _load_sheets(arguments: argparse.Namespace) -> list[TrialSheet]:
    """The trials files of --trials."""
    if not arguments.trials:
        return []
    from burg_drake.experiment import load_trials

    return [load_trials(path) for path in arguments.trials]


def _print_tables(
    comparisons: Sequence[benchmark.MethodComparison], sheets: Sequence[TrialSheet] = ()
) -> None:
    """Prints the tables of results, suite by suite."""
    for table in benchmark.all_tables(comparisons, sheets):
        table.text_table().show()
