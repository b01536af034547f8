"""Time stepping: grasp trials with their outcome and margins, and scenes that come to rest.

Read `trials` first; `settling` builds on `rest`, and `robustness` repeats trials.
"""
