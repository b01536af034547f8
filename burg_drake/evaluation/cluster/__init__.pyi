from .dask_executor import connect_cluster as connect_cluster
