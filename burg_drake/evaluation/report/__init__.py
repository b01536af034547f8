"""The report of a run as one self-contained HTML page."""

from __future__ import annotations

from burg_drake.core.lazy import attach

__all__, __getattr__, __dir__ = attach(
    __name__,
    {
        "burg_drake.evaluation.report.campaign": ["campaign_page", "write_campaign_report"],
        "burg_drake.evaluation.report.page": ["report_page", "write_report"],
    },
)
