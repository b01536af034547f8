"""Judging on other machines: scenes and stations that travel, workers of Dask, and their driver.

Read `dask_executor` first, then `dispatch`, which sends grasps and collects verdicts, and
`worker_tasks`, which runs in the workers. `document` describes how a cluster is reached or started.
"""
