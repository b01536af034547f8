"""Motions in records, in words and as options: nothing is lost on the way."""

from __future__ import annotations

import argparse
from dataclasses import replace

import pytest

from burg_drake.apps import Parser, add_motion_options, motion_from_options
from burg_drake.evaluation import motion_options, motion_text, read_motion, settings_numbers
from burg_drake.station import GraspMotion, Station, load_station

USUAL = GraspMotion()
MOTIONS = (
    USUAL,
    GraspMotion(standoff=0.07, retreat=1 / 30, lift_height=0.1 + 0.2),
    GraspMotion(retreat=0.1, lift_height=0.0, least_lift=0.0),
    GraspMotion(least_lift=0.02, lift_direction=(0.3, -0.1, 2.0)),
)


def asked(words: list[str]) -> argparse.Namespace:
    parser = Parser()
    add_motion_options(parser)
    return parser.parse_args(words)


def station_with(motion: GraspMotion) -> Station:
    station = load_station("panda_tabletop")
    return replace(station, document=replace(station.document, motion=motion))


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("usual", MOTIONS)
def test_options_ask_for_the_motion_wherever_a_station_has_another(motion, usual) -> None:
    words = motion_options(motion, usual)
    found = motion_from_options(asked(words), station_with(usual))
    assert replace(found, least_lift=found.shortest) == replace(motion, least_lift=motion.shortest)
    assert bool(words) == (
        replace(usual, least_lift=usual.shortest) != replace(motion, least_lift=motion.shortest)
    )


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_record_gives_back_the_motion(motion: GraspMotion) -> None:
    assert read_motion({"hold_time": 0.5, **settings_numbers(motion)}) == motion


def test_a_record_of_a_release_without_motions_is_of_the_usual_one() -> None:
    assert read_motion({"lift_height": 0.3, "lift_time": 1.25}) == USUAL


def test_words() -> None:
    assert motion_text(USUAL) == "standoff 100 mm, lift 300 mm"
    text = "standoff 100 mm, retreat 100 mm, lift 20 to 300 mm along [1, 0, 1]"
    tilted = GraspMotion(retreat=0.1, least_lift=0.02, lift_direction=(1.0, 0.0, 1.0))
    assert motion_text(tilted) == text
    assert len({motion_text(motion) for motion in MOTIONS}) == len(MOTIONS)
    assert motion_text(replace(USUAL, retreat=1e-9)) != motion_text(USUAL)
