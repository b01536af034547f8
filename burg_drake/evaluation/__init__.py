"""The main job: grasps on a station are judged stage by stage, and all of it is recorded.

Read `cascade` first: it prepares a run, and gives its candidates to an executor, whose workers send
each grasp through the stages of a `judge`. `run_folder` and `campaign_folder` read runs of one
scene and of many. The folders have grasps from samplers and files (`grasp_sets`), executors on
other machines (`cluster`) and the pages of results (`report`).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
