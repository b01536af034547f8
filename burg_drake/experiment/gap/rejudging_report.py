"""Results of judging trials again, as a section of a page and as a table for a terminal."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from itertools import product

from burg_drake.core import Stage, TextTable, count_with_noun, format_percent, outcome_label
from burg_drake.evaluation import command, section
from burg_drake.experiment.comparison.finding_tables import FindingTable
from burg_drake.experiment.gap.rejudging import (
    DISAGREEMENT_CAUSES,
    REJUDGED_TABLE_FILE,
    Rejudged,
    Rejudging,
)
from burg_drake.visualization import Html, element, interval_mark, join


def rejudged_sentences(rejudging: Rejudging) -> list[str]:
    """Sentences about the results."""
    if not rejudging.judged:
        return ["None of the trials could be judged again.", *_skipped_sentence(rejudging)]
    causes, whole = rejudging.causes, len(rejudging.predictable)
    planned, measured = (rejudging.agreement(measured=m)[0] for m in (False, True))
    count, wrong, low, high = rejudging.explained_disagreements
    sentences = _unpredictable_sentence(rejudging)
    if whole:
        sentences.append(
            f"Of {whole} {'other ' if sentences else ''}trials, each counted once whatever it"
            f" stands for, {planned} agree with the robot as planned"
            f" ({format_percent(planned / whole)}), and {measured} with the objects where they"
            f" stood ({format_percent(measured / whole)}); McNemar's exact test:"
            f" p = {rejudging.mcnemar_test.p_value:.2g}."
        )
    if wrong:
        sentences.append(
            f"Of the {wrong} that disagree{'s' if wrong == 1 else ''} as planned, placement"
            f" explains {count} ({format_percent(count / wrong)}, 95 % interval {100 * low:.0f} to"
            f" {100 * high:.0f} %), and {causes['physics']}"
            f" {'is' if causes['physics'] == 1 else 'are'} left to physics."
        )
    if causes["worsened"]:
        sentences.append(
            f"{causes['worsened']} agreed with the objects as planned, but not where they stood."
        )
    overlaps = sum(
        t.outcome is not None and t.outcome.stage is Stage.CLEAR for t in rejudging.judged
    )
    if overlaps:
        sentences.append(
            f"In {overlaps} trials the open hand would overlap a displaced object, which"
            " counts as a collision, although a robot may push it aside."
        )
    not_judged = [trial for trial in rejudging.trials if trial not in rejudging.judged]
    if not_judged:
        sentences.append(f"{len(not_judged)} could not be judged again.")
    return [*sentences, *_skipped_sentence(rejudging)]


def _unpredictable_sentence(rejudging: Rejudging) -> list[str]:
    """Sentence about unpredictable failures, and precision with and without them."""
    unpredictable = [trial for trial in rejudging.judged if trial.unpredictable]
    if not unpredictable:
        return []
    outcomes = Counter(outcome_label(trial.real) for trial in unpredictable)
    texts = ", ".join(f"{n} {name}" for name, n in outcomes.most_common())
    precision = "; ".join(
        f"{name} {_share_text(rejudging.precision(measured=m, every=True))} with them,"
        f" {_share_text(rejudging.precision(measured=m))} without"
        for name, m in (("as planned", False), ("as measured", True))
    )
    return [
        f"{count_with_noun(len(unpredictable), 'trial')} failed for reasons that a run of the hand"
        f" alone cannot predict ({texts}). They are counted separately, as neither placement"
        f" nor physics caused them. Precision {precision}."
    ]


def _share_text(count: tuple[int, int]) -> str:
    part, whole = count
    return f"{part} of {whole} ({format_percent(part / whole)})" if whole else "undefined"


def _skipped_sentence(rejudging: Rejudging) -> list[str]:
    counts = Counter(rejudging.skipped.values())
    parts = [f"{count} {why}" for why, count in counts.items()]
    return [f"Left out: {', '.join(parts)}."] if parts else []


def rejudged_view(rejudging: Rejudging) -> TextTable:
    """Table of causes for a terminal."""
    whole = len(rejudging.judged)
    table = TextTable(
        "Judged again where objects stood", caption=" ".join(rejudged_sentences(rejudging))
    )
    table.texts("verdict as planned, as measured").numbers("trials", "share %")
    for cause, text in DISAGREEMENT_CAUSES.items():
        count = rejudging.causes[cause]
        table.row(text, str(count), format_percent(count / whole) if whole else "-")
    return table


def rejudged_section(rejudging: Rejudging) -> Html:
    """Section with counts by cause, tables of both verdicts and reality, and the changed trials."""
    tables = _agreement_table(rejudging), _verdict_table(rejudging), _trial_list(rejudging)
    return section(
        "Judged again where objects stood",
        " ".join(rejudged_sentences(rejudging)),
        *(element("div", part, style="margin-top:20px") for part in tables if part is not None),
        element("p", f"Rows of {REJUDGED_TABLE_FILE} can be replayed in the scene as measured:"),
        command(_first_replay(rejudging)),
    )


def _agreement_table(rejudging: Rejudging) -> Html:
    """Table of the verdicts' agreement with the robot."""
    shown = FindingTable().names("verdict").numbers("right").shares("share with 95 % interval")
    cases = [("as planned", False, False), ("as measured", True, False)]
    if len(rejudging.predictable) < len(rejudging.judged):
        cases += [(f"{name}, with what cannot be predicted", m, True) for name, m, _ in cases]
    for name, measured, every in cases:
        whole = len(rejudging.judged if every else rejudging.predictable)
        count, low, high = rejudging.agreement(measured=measured, every=every)
        share = Html("-")
        if whole:
            mark = interval_mark(count / whole, low, high)
            share = join(mark, f" {format_percent(count / whole)}")
        shown.row(name, f"{count} of {whole}", ("", share))
    return shown.page_table()


def _verdict_table(rejudging: Rejudging) -> Html:
    """Table of both verdicts and reality."""
    shown = FindingTable().texts("as planned", "as measured")
    shown.numbers("robot: success", "robot: failure")
    words = {True: "success", False: "failure"}
    for planned, measured in product((True, False), repeat=2):
        counts = (rejudging.table[planned, measured, real] for real in (True, False))
        shown.row(words[planned], words[measured], *counts)
    return shown.page_table()


def _trial_list(rejudging: Rejudging) -> Html | None:
    """Trials by cause, changed ones first, and trials that were not judged."""
    # Heading of each group of trials, changed verdicts first.
    headings = {
        "placement": "Explained by placement",
        "worsened": "Worsened",
        "physics": "Left to physics",
        "unpredictable": "Not predictable",
        None: "Not judged",
    }
    groups = {
        head: [t for t in rejudging.trials if t.cause(rejudging.success) == cause]
        for cause, head in headings.items()
    }
    if not any(groups.values()):
        return None
    shown = FindingTable().texts("").numbers("trial")
    shown.texts("object", "planned", "as measured", "robot", "notes")
    for head, trials in groups.items():
        _add_trials(shown, trials, head)
    return shown.page_table()


def _add_trials(shown: FindingTable, trials: Sequence[Rejudged], head: str) -> None:
    max_rows = 40  # Maximum number of trials in a group.
    more = f" (first {max_rows} of {len(trials)})" if len(trials) > max_rows else ""
    for k, trial in enumerate(trials[:max_rows]):
        shown.row(
            "" if k else f"{head}{more}",
            f"{trial.number}",
            trial.object,
            outcome_label(trial.planned),
            outcome_label(trial.outcome) if trial.outcome else trial.failure_reason,
            outcome_label(trial.real),
            "; ".join(trial.notes),
        )


def _first_replay(rejudging: Rejudging) -> str:
    """Command that shows the first row of the table."""
    table_file = str(rejudging.path / REJUDGED_TABLE_FILE)
    return shlex.join(["burg-drake", "replay", table_file, "--row", "1"])
