"""Grasps from files and runs as sets to work on, and what sets say of their origin.

Read `input` first, then `candidate_files`; `sampled` and `scored` make sets."""
