"""The main job end to end: cascade, workers, run directory and report."""

from __future__ import annotations

from burg_drake.core.lazy import attach

__all__, __getattr__, __dir__ = attach(
    __name__,
    {
        "burg_drake.core.statistics": ["wilson_interval"],
        "burg_drake.evaluation.cascade": ["evaluate"],
        "burg_drake.evaluation.judge": ["Decision", "Judge", "Screen", "Verdict"],
        "burg_drake.core.progress": ["Progress"],
        "burg_drake.evaluation.feasibility": ["reach"],
        "burg_drake.evaluation.report": ["write_report"],
        "burg_drake.evaluation.run_store": ["Run", "load_run"],
        "burg_drake.evaluation.station_judge": ["StationJudge"],
        "burg_drake.evaluation.summary": ["summarize"],
        "burg_drake.evaluation.summary_tables": ["summary_view"],
        "burg_drake.evaluation.table_file": ["read_table"],
    },
)
