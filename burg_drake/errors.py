"""Errors: all are a `BurgError`, and a built-in one where that fits."""

from burg_drake.core import (
    ClusterError as ClusterError,
    DocumentError as DocumentError,
    FieldError as FieldError,
    InvalidInputError as InvalidInputError,
    MeshError as MeshError,
    MissingDependencyError as MissingDependencyError,
    SimulationError as SimulationError,
    TaskCancelled as TaskCancelled,
    UnknownNameError as UnknownNameError,
    WorkerDied as WorkerDied,
)
