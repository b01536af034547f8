"""Models of a library that cannot be exported."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from burg_drake.core import NO_PACKAGES, BurgError
from burg_drake.export import object_sdf_model
from burg_drake.objects import load_library


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("<mass>0.349<", "<mass>0.5<", "has a mass of 0.5 kg, but library.yaml says 0.349 kg"),
        ("<mass>0.349<", "<mass>heavy<", "has a mass of heavy kg"),
        (">mesh.obj<", ">gone.obj<", "can.sdf: gone.obj does not exist"),
        (">mesh.obj<", ">package://nowhere/gone.obj<", "package 'nowhere' is not found"),
        ("<sdf", "<<sdf", "can.sdf is not an SDF"),
        ("</link>", "</link><include><uri>x</uri></include>", "includes other models"),
        ("model", "world", "has no model"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, old: str, new: str, expected: str) -> None:
    root = load_library("household").root
    shutil.copy(root / "library.yaml", tmp_path)
    shutil.copytree(root / "can", tmp_path / "can")
    sdf = tmp_path / "can" / "can.sdf"
    assert old in sdf.read_text()
    sdf.write_text(sdf.read_text().replace(old, new))
    library = load_library(tmp_path)
    with pytest.raises(BurgError) as caught:
        object_sdf_model(library, "can", library.entry("can"), tmp_path / "out", NO_PACKAGES)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
