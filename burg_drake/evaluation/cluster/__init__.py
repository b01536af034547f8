"""Judging on other machines: scenes and stations that travel, workers of Dask, and their driver."""
