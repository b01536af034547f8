"""How many small faults, made in the code on purpose, the tests notice.

    python benchmarks/mutation.py [GROUP ...] [--mutants N] [--minutes M] [--seed N] [-o OUT.json]
    python benchmarks/mutation.py --again OUT.json

For each group of modules it takes a random sample of mutants: one comparison, operator, constant,
condition or return value changed, or one statement left out. Against each mutant it runs the test
files that mirror the module, and nothing else, so that a survivor says what those tests leave open;
another file may see it. A mutant is killed when a test fails, or when they take several times as
long as without it. All happens in a copy; the checkout is only read.

`--again` tries the survivors of an earlier run once more, after tests were added. The changes are
found by their text, so that other lines may have moved.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import json
import math
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE, TESTS = "burg_drake/", "tests/"
Modules = dict[str, tuple[str, ...]]
GROUPS: dict[str, Modules] = {
    "core": {
        "core/statistics": ("core/test_statistics",),
        "core/content": ("core/test_content",),
        "core/grasps/grasp_set": ("core/test_grasps",),
        "core/grasps/storage": ("core/test_grasps",),
        "core/documents/schema": ("core/test_schema",),
        "core/documents/reader": ("core/test_schema",),
        "core/documents/yaml_nodes": ("core/test_schema",),
        "core/files/atomic": ("core/test_files",),
        "core/errors": ("core/test_errors",),
        "core/workers/processes": ("core/test_processes",),
    },
    "statistics": {
        "core/statistics": ("core/test_statistics",),
        "experiment/statistics/confusion": ("experiment/test_agreement",),
        "experiment/statistics/estimates": ("experiment/test_agreement",),
        "experiment/statistics/paired_answers": ("experiment/test_agreement",),
        "experiment/statistics/resampling": ("experiment/test_agreement",),
        "experiment/statistics/margin_calibration": ("experiment/test_calibration",),
        "experiment/statistics/rank_statistics": ("experiment/test_calibration",),
        "experiment/comparison/standing_out": ("experiment/test_sim_to_real",),
    },
    "verdicts": {
        "core/grasps/outcome": ("core/test_outcome",),
        "evaluation/stages/judge": ("evaluation/test_judge",),
        "evaluation/stages/screening": ("evaluation/test_judge", "evaluation/test_arm_mode"),
        "evaluation/records/rows": ("evaluation/test_rows",),
        "evaluation/records/journal": ("evaluation/test_journal",),
        "evaluation/results/counts": ("evaluation/test_summary",),
        "evaluation/results/summary": ("evaluation/test_summary",),
        "simulation/trials/execution": ("simulation/test_hand_trial",),
        "simulation/trials/contacts": ("simulation/test_hand_trial",),
        "simulation/robustness/bisection": ("simulation/test_limit",),
        "simulation/trials/grip_motion": ("simulation/test_limits_in_hand",),
        "simulation/rest/body_motions": ("simulation/test_body_motions",),
    },
    "trials": {
        "experiment/trials/book": ("experiment/test_trial_book",),
        "experiment/trials/entries": ("experiment/test_trial_book",),
        "experiment/trials/file_lock": ("experiment/test_trial_book",),
        "experiment/trials/given_entry": ("experiment/test_trial_book",),
        "experiment/trials/sheet_text": ("experiment/test_trial_book",),
        "evaluation/run/balancing": ("evaluation/test_balanced",),
        "evaluation/results/notes": ("evaluation/test_balanced", "evaluation/test_run_notes"),
    },
    "frames": {
        "core/frames": ("core/test_frames",),
        "formats/common/rigid": ("formats/test_rigid",),
        "formats/common/convention": ("formats/test_grasp_convention",),
        "evaluation/candidates/scene_frame": ("evaluation/test_placement",),
    },
    "formats": {
        "formats/grasps/acronym": ("formats/test_acronym",),
        "formats/grasps/burg_toolkit": ("formats/test_burg_grasps",),
        "formats/common/conversion": ("formats/test_conversion",),
        "formats/grasp_files": ("formats/test_grasp_files",),
        "formats/grasps/graspgen": ("formats/test_graspgen",),
        "formats/grasps/graspnet": ("formats/test_graspnet",),
        "formats/grasps/isaac_reader": ("formats/test_isaac_grasp",),
        "formats/grasps/isaac_writer": ("formats/test_isaac_grasp",),
        "formats/common/one_object": ("formats/test_one_object", "formats/test_acronym"),
        "formats/common/pose_file": ("formats/test_pose_file",),
        "formats/grasps/vgn": ("formats/test_vgn",),
    },
    "reach": {
        "motion/reach/verdict": ("motion/test_reach", "motion/test_reach_reasons"),
        "motion/reach/arm_reach": ("motion/test_reach", "motion/test_reach_reasons"),
        "motion/reach/attempt": ("motion/test_reach", "motion/test_reach_reasons"),
        "motion/lines/failure_reason": ("motion/test_reach_reasons",),
        "motion/collision/checker": ("motion/test_collision",),
        "motion/ik/limits": ("motion/test_limits",),
        "motion/ik/panda": ("motion/test_panda_ik",),
    },
    "pose": {
        "cameras/pose/estimator": ("cameras/test_board_pose",),
        "cameras/pose/coarse": ("cameras/test_board_pose",),
        "cameras/pose/edge_fit": ("cameras/test_board_pose",),
        "cameras/pose/refinement": ("cameras/test_board_pose", "cameras/test_detection"),
        "cameras/pose/edge_projection": ("cameras/test_detection",),
        "cameras/pose/edges": ("cameras/test_detection",),
        "cameras/pose/detection": ("cameras/test_detection",),
        "cameras/pose/quadrilaterals": ("cameras/test_quadrilaterals", "cameras/test_detection"),
        "cameras/systems/pose_filter": ("cameras/test_pose_filter",),
    },
}
"""Modules, and the test files that mirror each."""
PATIENCE, LEAST_PATIENCE = 6.0, 60.0
"""A mutant is killed when its tests take so many times as long as without it, and this long [s]."""
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
OPPOSITES = {"min": "max", "any": "all", "argmin": "argmax"}
OPPOSITES |= {value: key for key, value in OPPOSITES.items()}


@dataclass(frozen=True)
class Mutant:
    """One change of a source file.

    Attributes:
        module: path of the file in the checkout.
        line: where.
        start, end: the changed text, in bytes from the start of the file.
        before, after: what stands there, and what instead.
        place: the text of the line.
    """

    module: str
    line: int
    start: int
    end: int
    before: str
    after: str
    place: str

    def __str__(self) -> str:
        before, after = (" ".join(text.split()) for text in (self.before, self.after))
        return f"{self.module}:{self.line}: {before[:90]}  ->  {after[:90]}"

    def found_in(self, source: bytes) -> Mutant | None:
        """Itself, where its line stands now; None if that has changed."""
        at, offset = source.find(self.place.encode()), self.start - self._line_start
        start = at + offset
        end = start + len(self.before.encode())
        if at < 0 or source[start:end] != self.before.encode():
            return None
        return Mutant(**asdict(self) | {"start": start, "end": end, "line": _line(source, start)})

    @property
    def _line_start(self) -> int:
        return self.start - self.place.encode().index(self.before.encode().splitlines()[0])

    def applied(self, source: bytes) -> bytes:
        """The file with the change."""
        return source[: self.start] + self.after.encode() + source[self.end :]


@dataclass
class Score:
    """What became of a group's mutants."""

    killed: int = 0
    survived: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        total = self.killed + self.survived
        share = 100 * self.killed / max(1, total)
        return f"{self.killed} of {total} killed, {share:.0f} %; {self.seconds:.0f} CPU s"


def mutants_of(module: str, source: str) -> list[Mutant]:
    """All mutants of a file."""
    data = source.encode()
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = {}
    for node, after in _changes(ast.parse(source)):
        start = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        before = data[start:end].decode()
        if before != after:
            place = data[starts[node.lineno - 1] : max(end, starts[node.lineno])].decode()
            mutant = Mutant(module, node.lineno, start, end, before, after, place)
            found[start, end, after] = mutant
    return list(found.values())


def _changes(tree: ast.Module) -> Iterator[tuple[ast.AST, str]]:
    """Nodes with what to put in their place. Messages, annotations and imports stay."""
    stack: list[ast.AST] = [tree]
    while stack:
        node = stack.pop()
        yield from _changed(node)
        stack += [child for child in ast.iter_child_nodes(node) if child not in _untouched(node)]


def _untouched(node: ast.AST) -> list[ast.AST]:
    """Children that hold no logic."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return list(node.body)
        case ast.Raise() | ast.JoinedStr() | ast.Assert():
            return list(ast.iter_child_nodes(node))
        case ast.FunctionDef(returns=returns, decorator_list=decorators):
            return [*decorators, *([returns] if returns else [])]
        case ast.ClassDef(decorator_list=decorators):
            return decorators
        case ast.arg(annotation=annotation) | ast.AnnAssign(annotation=annotation):
            return [annotation] if annotation else []
        case ast.Assign(targets=[ast.Name(id=name)]) if name[0].isupper() and name != name.upper():
            return [node.value]  # an alias of types
        case _:
            return []


def _changed(node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
    match node:
        case ast.Compare(left, [operator, *rest], values) if type(operator) in COMPARISONS:
            other = ast.Compare(left, [COMPARISONS[type(operator)](), *rest], values)
            yield node, f"({ast.unparse(other)})"
        case ast.BoolOp(operator, values):
            other_operator = ast.Or() if isinstance(operator, ast.And) else ast.And()
            yield node, f"({ast.unparse(ast.BoolOp(other_operator, values))})"
            for k in range(len(values)):
                rest = values[:k] + values[k + 1 :]
                left_out = rest[0] if len(rest) == 1 else ast.BoolOp(operator, rest)
                yield node, f"({ast.unparse(left_out)})"
        case ast.BinOp(left, ast.MatMult(), right):
            yield node, f"({ast.unparse(ast.BinOp(right, ast.MatMult(), left))})"
        case ast.BinOp(left, operator, right) if type(operator) in OPERATORS:
            if not any(isinstance(x, ast.JoinedStr | ast.List) for x in (left, right)):
                other = ast.BinOp(left, OPERATORS[type(operator)](), right)
                yield node, f"({ast.unparse(other)})"
        case ast.UnaryOp(ast.USub() | ast.Not() | ast.Invert(), operand):
            yield node, f"({ast.unparse(operand)})"
        case ast.Constant(bool() as value):
            yield node, repr(not value)
        case ast.Constant(int() as value):
            yield node, repr(value + 1)
        case ast.Constant(float() as value):
            yield node, repr(1.0 if value == 0.0 else 0.1 * value)
        case ast.IfExp(test) | ast.If(test) | ast.While(test):
            if ast.unparse(test) != "TYPE_CHECKING":
                yield test, f"(not ({ast.unparse(test)}))"
        case ast.Attribute(value, "T"):
            yield node, ast.unparse(value)
        case ast.Call(ast.Name(name), arguments, keywords) if name in OPPOSITES:
            yield node, ast.unparse(ast.Call(ast.Name(OPPOSITES[name]), arguments, keywords))
        case ast.Call(ast.Attribute(value, name), arguments, keywords) if name in OPPOSITES:
            called = ast.Attribute(value, OPPOSITES[name])
            yield node, ast.unparse(ast.Call(called, arguments, keywords))
        case ast.Return(ast.expr() as value) if not isinstance(value, ast.Constant):
            yield value, "None"
        case ast.Raise() | ast.Continue() | ast.Break() | ast.AugAssign():
            yield node, "pass"
        case ast.Expr(ast.Call()):
            yield node, "pass"


class Copy:
    """A copy of the checkout, in which mutants are made and tests run."""

    def __init__(self, place: Path) -> None:
        self.path = place / "tree"
        listed = subprocess.run(
            ["git", "ls-files", "-coz", "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            check=True,
        ).stdout.decode()
        for name in filter(None, listed.split("\0")):
            if (ROOT / name).is_file():
                (self.path / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, self.path / name)
        self._environment = {
            **os.environ,
            "PYTHONPATH": str(self.path),
            "PYTHONPYCACHEPREFIX": str(place / "cache"),
            "TMPDIR": str(place / "tmp"),
        }
        (place / "tmp").mkdir()
        self._written = int(time.time())
        self._usual: dict[tuple[str, ...], float] = {}

    def source(self, module: str) -> str:
        return (self.path / module).read_text(encoding="utf-8")

    def kills(self, mutant: Mutant, tests: tuple[str, ...]) -> bool:
        """Whether the tests notice a mutant."""
        if tests not in self._usual:
            start = time.monotonic()
            if self._run(tests, math.inf) != 0:
                raise SystemExit(f"without any mutant {' '.join(tests)} fails")
            self._usual[tests] = time.monotonic() - start
        path = self.path / mutant.module
        original = path.read_bytes()
        try:
            self._write(path, mutant.applied(original))
            return self._run(tests, max(LEAST_PATIENCE, PATIENCE * self._usual[tests])) != 0
        finally:
            self._write(path, original)

    def _write(self, path: Path, content: bytes) -> None:
        """Writes a source file with a time of its own, by which Python knows stale bytecode."""
        path.write_bytes(content)
        self._written += 2
        os.utime(path, (self._written, self._written))

    def _run(self, tests: tuple[str, ...], limit: float) -> int:
        """Exit code of pytest, which is ended after `limit` seconds."""
        command = [sys.executable, "-m", "pytest", "-n0", "-x", "-q", "-p", "no:cacheprovider"]
        process = subprocess.Popen(
            [*command, *tests],
            cwd=self.path,
            env=self._environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            return process.wait(None if math.isinf(limit) else limit)
        except subprocess.TimeoutExpired:
            return 1
        finally:
            with contextlib.suppress(ProcessLookupError):  # workers of a hung test
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=", ".join(GROUPS))
    parser.add_argument("--mutants", type=int, default=60, help="a group (default: %(default)s)")
    parser.add_argument("--minutes", type=float, default=6.0, help="CPU a group (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--again", metavar="OUT.json", help="try its survivors again")
    parser.add_argument("-o", "--output", default="survivors.json", metavar="OUT.json")
    arguments = parser.parse_args()
    for name in arguments.groups:
        if name not in GROUPS:
            parser.error(f"no group {name!r}; there are {', '.join(GROUPS)}")
    with tempfile.TemporaryDirectory() as place:
        copy = Copy(Path(place))
        if arguments.again:
            _again(copy, Path(arguments.again), arguments.groups)
        else:
            _sample(copy, arguments)


def _sample(copy: Copy, arguments: argparse.Namespace) -> None:
    scores: dict[str, Score] = {}
    survivors: dict[str, list[dict[str, object]]] = {}
    for group in arguments.groups or GROUPS:
        score = scores[group] = Score()
        survivors[group] = []
        for mutant, tests in _chosen(copy, group, arguments.seed)[: arguments.mutants]:
            if score.seconds > 60.0 * arguments.minutes:
                break
            before = _children_cpu()
            if copy.kills(mutant, tests):
                score.killed += 1
            else:
                score.survived += 1
                survivors[group].append(asdict(mutant))
                print(f"{group}: survived {mutant}", flush=True)
            score.seconds += _children_cpu() - before
            report = {"scores": {k: asdict(s) for k, s in scores.items()}, "survivors": survivors}
            Path(arguments.output).write_text(json.dumps(report, indent=1), encoding="utf-8")
        print(f"{group}: {score}", flush=True)


def _chosen(copy: Copy, group: str, seed: int) -> list[tuple[Mutant, tuple[str, ...]]]:
    """The group's mutants in random order, a turn for each module as often as it has lines."""
    found = []
    for module, tests in GROUPS[group].items():
        path = f"{PACKAGE}{module}.py"
        files = tuple(f"{TESTS}{name}.py" for name in tests)
        found += [(mutant, files) for mutant in mutants_of(path, copy.source(path))]
    random.Random(f"{seed} {group}").shuffle(found)
    return found


def _again(copy: Copy, path: Path, groups: list[str]) -> None:
    report = json.loads(path.read_text(encoding="utf-8"))
    for group, survivors in report["survivors"].items():
        if groups and group not in groups:
            continue
        tests = {f"{PACKAGE}{m}.py": names for m, names in GROUPS[group].items()}
        killed = 0
        for data in survivors:
            before = Mutant(**data)
            mutant = before.found_in(copy.source(before.module).encode())
            if mutant is None:
                print(f"{group}: gone {before}", flush=True)
                continue
            files = tuple(f"{TESTS}{name}.py" for name in tests[mutant.module])
            dead = copy.kills(mutant, files)
            killed += dead
            print(f"{group}: {'killed' if dead else 'survived'} {mutant}", flush=True)
        score = report["scores"][group]
        total = score["killed"] + score["survived"]
        print(f"{group}: {score['killed'] + killed} of {total} killed", flush=True)


def _line(source: bytes, at: int) -> int:
    return source[:at].count(b"\n") + 1


def _children_cpu() -> float:
    """CPU time of all processes that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
