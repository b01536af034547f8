"""The options of the hand's motion: what they mean, and what is refused in one line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from burg_drake.apps import (
    Parser,
    add_motion_options,
    describe_motion_remedy,
    main,
    motion_from_options,
)
from burg_drake.evaluation import motion_remedy
from burg_drake.station import GraspMotion, load_station


def test_an_option_counts_more_than_the_station_and_that_more_than_the_usual() -> None:
    station = load_station("panda_tabletop")
    own = GraspMotion(retreat=0.05, least_lift=0.02)
    station = replace(station, document=replace(station.document, motion=own))
    parser = Parser()
    add_motion_options(parser)
    assert motion_from_options(parser.parse_args([]), station) == own
    words = ["--retreat-mm", "0", "--lift-mm", "150", "--lift-direction", "0", "1", "1"]
    assert motion_from_options(parser.parse_args(words), station) == GraspMotion(
        retreat=0.0, lift_height=0.15, least_lift=0.02, lift_direction=(0.0, 1.0, 1.0)
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            "reach --lift-mm 10 --least-lift-mm 20",
            "give at most lift_height (--lift-mm, --least-lift-mm)",
        ),
        ("reach --lift-mm 0", "at least 1 mm with the object (--lift-mm)"),
        ("reach --lift-direction 0 0 0", "[0, 0, 1] for up (--lift-direction)"),
        ("evaluate --retreat-mm -1", "--retreat-mm: -1 is not a length from 0 to 1000 mm"),
        ("evaluate --lift-mm 9000", "--lift-mm: 9000 is not a length from 0 to 2000 mm"),
        ("evaluate --lift-direction 0 0", "--lift-direction: expected 3 arguments"),
        ("evaluate --mode hand --standoff-mm 50", "--standoff-mm is the length of the approach;"),
        ("evaluate --mode arm --approach", "approaches anyway; leave approach out, or give mode"),
        ("evaluate --tilt-limit 0", "--tilt-limit: 0 is not an angle in degrees above 0, at most"),
        ("evaluate --tilt-limit inf", "--tilt-limit: 'inf' is not a finite number"),
        ("evaluate --slip-limit-mm 0", "--slip-limit-mm: 0 is not above 0"),
    ],
)
def test_what_no_hand_can_do_is_one_line(words: str, message: str, capsys) -> None:
    verb, *options = words.split()
    try:
        code = main([verb, "tabletop_six", *options])
    except SystemExit as ended:  # of the parser
        code = ended.code
    error = capsys.readouterr().err
    assert code == 2
    assert message in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("outcomes", "motion", "text", "option"),
    [
        (
            ["lift_line", "hand_collision_lift", "reachable", "collision_table", "collision_table"],
            GraspMotion(retreat=0.1),
            "2 of 3 grasps fail on the lift of 300 mm; one as high as there is room, at least"
            " 20 mm, may help",
            "--least-lift-mm 20 asks for the shorter lift",
        ),
        (
            ["retreat_line", "hand_collision_retreat", "no_ik"],
            GraspMotion(retreat=0.1),
            "2 of 3 grasps fail on the retreat of 100 mm; one of 50 mm may help",
            "--retreat-mm 50 asks for the shorter retreat",
        ),
    ],
)
def test_a_lift_or_retreat_that_fails_most_grasps_names_the_option(
    outcomes: list[str], motion: GraspMotion, text: str, option: str
) -> None:
    """The library says what fails; only commands name options."""
    remedy = motion_remedy(outcomes, motion)
    assert remedy is not None and remedy.text == text
    assert describe_motion_remedy(remedy) == option


def test_a_lift_that_is_short_already_or_fails_few_needs_no_remedy() -> None:
    failing = ["hand_collision_lift"] * 3
    assert motion_remedy(failing, GraspMotion(least_lift=0.02)) is None
    assert motion_remedy([*failing, *["reachable"] * 3], GraspMotion()) is None
    assert motion_remedy([], GraspMotion()) is None
