"""How the objects of a grasp file are found."""

from __future__ import annotations

import argparse

import numpy as np
import pytest

from burg_drake.apps import load_grasp_source, open_grasp_source
from burg_drake.core import GraspSet, InvalidInputError, UnknownNameError


def options(scene: str | None = None, library: str | None = None) -> argparse.Namespace:
    return argparse.Namespace(scene=scene, library=library)


def on(object: str, **provenance: str) -> GraspSet:
    return GraspSet.create(np.eye(4), object=object, provenance=provenance)


@pytest.mark.parametrize("reference", ["tabletop_six", "household"])
def test_what_was_opened_is_found_again_by_its_reference(reference: str):
    source = open_grasp_source(reference)
    again = load_grasp_source(options(), on("mug", **source.reference()), "grasps.h5")
    assert again.library.root == source.library.root
    assert (again.scene is None) == (source.scene is None) == (reference == "household")


def test_a_library_is_known_by_its_folder_and_its_document():
    root = open_grasp_source("household").library.root
    assert open_grasp_source(str(root)).library.root == root
    assert open_grasp_source(str(root / "library.yaml")).library.root == root


def test_options_come_before_what_the_file_names():
    grasps = on("mug", scene="gone.yaml")
    assert load_grasp_source(options(library="household"), grasps, "grasps.h5").scene is None


def test_what_cannot_be_found_is_said():
    with pytest.raises(UnknownNameError, match=r"neither a scene nor .* mean 'household'"):
        open_grasp_source("houshold")
    with pytest.raises(InvalidInputError, match=r"mine.h5 does not say .* --scene or --library"):
        load_grasp_source(options(), on("mug"), "mine.h5")
    with pytest.raises(UnknownNameError, match=r"mine.h5 says .* in gone.yaml, which is not"):
        load_grasp_source(options(), on("mug", scene="gone.yaml"), "mine.h5")
    with pytest.raises(UnknownNameError, match=r"mine.h5 has grasps of object 'mog'.*'mug'"):
        load_grasp_source(options(library="household"), on("mog"), "mine.h5")
