"""Trials on the real robot beside simulated ones: choice, records, comparison, the gap.

`trials` has the file of trials and `planning` makes it; `comparison` rests on `pairing` and
`statistics`, and `gap` on all of them.
"""
