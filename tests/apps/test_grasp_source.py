"""Where the objects of a grasp file are found."""

from __future__ import annotations

import argparse

import numpy as np
import pytest

from burg_drake.apps.grasps.source import open_source, source_of
from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.grasps.grasp_set import GraspSet


def options(scene: str | None = None, library: str | None = None) -> argparse.Namespace:
    return argparse.Namespace(scene=scene, library=library)


def on(object: str, **provenance: str) -> GraspSet:
    return GraspSet.create(np.eye(4), object=object, provenance=provenance)


@pytest.mark.parametrize("reference", ["tabletop_six", "household"])
def test_what_was_opened_is_found_again_by_its_reference(reference: str):
    source = open_source(reference)
    again = source_of(options(), on("mug", **source.reference()), "grasps.h5")
    assert again.library.root == source.library.root
    assert (again.scene is None) == (source.scene is None) == (reference == "household")


def test_a_library_is_known_by_its_folder_and_its_document():
    root = open_source("household").library.root
    assert open_source(str(root)).library.root == root
    assert open_source(str(root / "library.yaml")).library.root == root


def test_options_come_before_what_the_file_names():
    grasps = on("mug", scene="gone.yaml")
    assert source_of(options(library="household"), grasps, "grasps.h5").scene is None


def test_what_cannot_be_found_is_said():
    with pytest.raises(UnknownNameError, match=r"neither a scene nor .* mean 'household'"):
        open_source("houshold")
    with pytest.raises(InvalidInputError, match=r"mine.h5 does not say .* --scene or --library"):
        source_of(options(), on("mug"), "mine.h5")
    with pytest.raises(UnknownNameError, match=r"mine.h5 says .* in gone.yaml, which is not"):
        source_of(options(), on("mug", scene="gone.yaml"), "mine.h5")
    with pytest.raises(UnknownNameError, match=r"mine.h5 has grasps of object 'mog'.*'mug'"):
        source_of(options(library="household"), on("mog"), "mine.h5")
