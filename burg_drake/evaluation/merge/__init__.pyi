from .runs import (
    merge_runs as merge_runs,
    unite as unite,
)
