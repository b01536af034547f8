"""Grasp trials by a second method, to judge the first: an elastic foundation with bristles.

It shares no code with the engine that it judges: numpy and numba only, nothing of Drake and nothing
of this project. `trial` runs one grasp, `catalogue` has the objects, `cases` the hard grasps, and
`../contact_oracle.py` compares. What is the same are the facts of the task: the size, stiffness and
force of the hand, and the phases of a trial (`hand`).
"""
