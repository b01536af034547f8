from .runs import (
    merge_folders as merge_folders,
    merge_runs as merge_runs,
)
