"""Comparison of simulated with real outcomes, and of two runs.

Read `run_comparison` first, then `comparison`; `judge_assessment` has the figures."""
