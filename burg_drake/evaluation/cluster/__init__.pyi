from .dask_executor import (
    DaskExecutor as DaskExecutor,
    connect_cluster as connect_cluster,
)
