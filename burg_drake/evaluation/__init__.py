"""Evaluation of grasps on a station: judges them stage by stage and records the results.

Read `cascade` first: it prepares a run and gives its candidates to an executor, whose workers send
each grasp through the stages of a `judge`. `run_folder` and `campaign_folder` read runs of one
scene and of many. Subpackages: `grasp_sets` reads and samples grasps, `cluster` has executors on
other machines, `report` writes the report pages.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
