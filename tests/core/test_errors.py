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
    assert errors.suggest_names("mog", known) == "did you mean 'mug'? Known: bowl, marble, mug"
    assert (
        errors.suggest_names("panda", ["panda_wsg", "panda_bin"]) == "known: panda_bin, panda_wsg"
    )
    assert errors.suggest_names("panda", ["ur5e", "panda_bin"]).startswith(
        "did you mean 'panda_bin'?"
    )
    assert errors.suggest_names("spaceship", known) == "known: bowl, marble, mug"
    assert errors.suggest_names("spaceship", known, ordered=True) == "known: mug, bowl, marble"
    assert errors.suggest_names("mug", []) == "known: (none)"


def test_of_many_names_the_first_few_are_listed():
    many = [f"mug_{k:02}" for k in range(25)]
    assert errors.list_names(many[:24]).endswith("mug_22, mug_23")
    first = "mug_00, mug_01, mug_02, mug_03, mug_04, mug_05, mug_06, mug_07, mug_08"
    assert errors.suggest_names("bowl", many) == f"known: {first} and 16 others"


def test_a_field_error_keeps_its_place_on_the_way_back_from_a_worker_process():
    error = pickle.loads(pickle.dumps(errors.FieldError("mass is -1", "parts", 0, "mass")))
    assert str(error) == "mass is -1" and error.place == ("parts", 0, "mass")


def test_a_text_from_outside_is_repeated_up_to_a_length() -> None:
    assert errors.shorten_text("ten digits", 10) == "ten digits"
    assert errors.shorten_text("eleven digits", 10) == "eleven ..."
    assert len(errors.quote_value("x" * 1000)) < 200
