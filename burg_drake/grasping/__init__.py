"""Grasps without time stepping: sampled, screened, scored and compared.

`sampling` and `clearance` are on the main road; `similarity` is what `comparison` rests on.
"""
