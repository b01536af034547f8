"""Judging on other machines: bundles of scene and station, Dask workers, and their driver.

Read `dask_executor` first, then `jobs` (grasps or calls), `dispatch`, which sends them and collects
results, and `worker_tasks`, which runs in the workers. `document` describes how to reach or start a
cluster.
"""
