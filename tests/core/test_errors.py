from __future__ import annotations

import pickle

import pytest

from burg_drake.core import errors


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (errors.InvalidInputError, ValueError),
        (errors.DocumentError, ValueError),
        (errors.MeshError, ValueError),
        (errors.UnknownNameError, KeyError),
        (errors.MissingDependencyError, ImportError),
        (errors.SimulationError, RuntimeError),
    ],
)
def test_every_error_is_caught_as_burg_error_and_as_builtin(kind, builtin):
    for expected in (errors.BurgError, builtin):
        with pytest.raises(expected) as caught:
            raise kind("one clear line")
        assert str(caught.value) == "one clear line"


def test_errors_survive_the_way_back_from_a_worker_process():
    error = pickle.loads(pickle.dumps(errors.UnknownNameError("object 'mog' is not there")))
    assert type(error) is errors.UnknownNameError
    assert str(error) == "object 'mog' is not there"


def test_nearest_suggests_and_lists():
    known = ["mug", "bowl", "marble"]
    assert errors.nearest("mog", known) == "did you mean 'mug'? Known: bowl, marble, mug"
    assert errors.nearest("spaceship", known) == "Known: bowl, marble, mug"
    assert errors.nearest("mug", []) == "Known: (none)"
