"""Simulated and real outcomes held against each other.

Read `comparing` and `comparison` first, then `of_trials` and `of_runs`; `judge_assessment` has the
figures."""
