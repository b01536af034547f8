"""Judging on other machines: scenes and stations that travel, workers of Dask, and their driver.

Read `document` and `dask_executor` first, then `dispatch` and `remote`, its two ends."""
