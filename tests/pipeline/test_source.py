"""What an object may be built from."""

from __future__ import annotations

import math

import pytest
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.pipeline import ObjectSource, check_source, object_name

BOX = trimesh.creation.box((0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("003_cracker_box", "003_cracker_box"),
        ("Bleach Cleanser (2)", "bleach_cleanser_2"),
        ("__A--b..c__", "a_b_c"),
        ("Käse", "k_se"),
    ],
)
def test_names_from_file_stems(text: str, name: str) -> None:
    assert object_name(text) == name
    assert object_name(name) == name


def test_stems_without_letters() -> None:
    with pytest.raises(InvalidInputError, match="'---' gives no object name"):
        object_name("---")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass": 0.0}, "box: mass is 0 kg; it must be above 0 (leave it out to use a density)"),
        ({"mass": -0.2}, "box: mass is -0.2 kg; it must be above 0"),
        ({"mass": math.nan}, "box: mass is nan kg; it must be above 0"),
        ({"density": 0.0}, "box: density is 0 kg/m^3; it must be above 0"),
        ({"scale": -1.0}, "box: scale is -1; it must be above 0"),
        ({"friction": -0.1}, "box: friction is -0.1; it must be at least 0"),
        ({"friction": math.nan}, "box: friction is nan; it must be at least 0"),
        (
            {"rgba": (1.0, 0.0, 0.0, 2.0)},
            "box: rgba is [1.0, 0.0, 0.0, 2.0]; each number must be from 0 to 1",
        ),
        ({"name": "My Box"}, "'My Box' is not a valid object name; use a-z, 0-9 and underscores"),
        ({"name": "../x"}, "'../x' is not a valid object name; use a-z"),
    ],
)
def test_numbers_that_no_object_has(change: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(InvalidInputError) as caught:
        check_source(ObjectSource(**{"name": "box", "mesh": BOX, **change}))
    assert str(caught.value).startswith(message)


def test_frictionless_is_allowed() -> None:
    source = ObjectSource(name="ice", mesh=BOX, friction=0.0)
    check_source(source)
    assert source.coefficient == 0.0
    assert ObjectSource(name="box", mesh=BOX).coefficient == 0.24
