from .dask_executor import (
    DaskExecutor as DaskExecutor,
    connect_cluster as connect_cluster,
    map_on_cluster as map_on_cluster,
)
