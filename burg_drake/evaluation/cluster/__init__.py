"""Judging on other machines: scenes and stations that travel, workers of Dask, and their driver.

Read `dask_executor` first, then `jobs` (grasps or calls), `dispatch`, which sends them and collects
results, and `worker_tasks`, which runs in the workers. `document` describes how a cluster is
reached or started.
"""
