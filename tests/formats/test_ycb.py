"""The YCB set in the layouts that people have."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.formats import (
    YCB_MASS_SOURCE,
    YCB_MASSES,
    YCB_NAMES,
    YcbObject,
    find_ycb,
    find_ycb_name,
)


def make(folder: Path, *files: str) -> Path:
    for file in files:
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    return folder


def meshes(folder: Path) -> dict[str, str]:
    return {o.name: str(o.mesh.relative_to(folder)) for o in find_ycb(folder)}


DOWNLOAD = (
    "003_cracker_box/clouds/merged_cloud.ply",
    "003_cracker_box/google_16k/kinbody.xml",
    "003_cracker_box/google_16k/nontextured.ply",
    "003_cracker_box/google_16k/nontextured.stl",
    "003_cracker_box/google_16k/textured.mtl",
    "003_cracker_box/google_16k/textured.obj",
    "003_cracker_box/google_16k/texture_map.png",
    "003_cracker_box/google_512k/textured.obj",
    "003_cracker_box/google_64k/textured.obj",
    "003_cracker_box/poisson/textured.obj",
    "003_cracker_box/tsdf/textured.obj",
)


def test_an_object_of_the_downloads(tmp_path: Path) -> None:
    assert find_ycb(make(tmp_path, *DOWNLOAD)) == [
        YcbObject(
            number="003",
            name="003_cracker_box",
            mesh=tmp_path / "003_cracker_box/google_16k/textured.obj",
            variant="google_16k",
            mass=0.411,
            mass_source=YCB_MASS_SOURCE,
        )
    ]


def test_the_best_scan_that_is_there(tmp_path: Path) -> None:
    """Whatever is taken away, the next best is found."""
    make(tmp_path, *DOWNLOAD)
    chosen = []
    while True:
        try:
            (item,) = find_ycb(tmp_path)
        except InvalidInputError:
            break
        chosen.append(str(item.mesh.relative_to(tmp_path / "003_cracker_box")))
        item.mesh.unlink()
    assert chosen == [
        "google_16k/textured.obj",
        "google_16k/nontextured.ply",
        "google_16k/nontextured.stl",
        "google_64k/textured.obj",
        "google_512k/textured.obj",
        "poisson/textured.obj",
        "tsdf/textured.obj",
    ]


@pytest.mark.parametrize(
    ("file", "variant"),
    [
        ("ycb/025_mug/google_64k/textured.obj", "google_64k"),
        ("ycb/025_mug_google_16k/025_mug/google_16k/textured.obj", "google_16k"),
        ("025_mug_google_16k/textured.obj", "google_16k"),
        ("025_mug_berkeley_meshes/025_mug/poisson/nontextured.stl", "poisson"),
        ("models/025_mug/textured_simple.obj", ""),
        ("025_mug.obj", ""),
        ("025_mug.glb", ""),
        ("025_mug_textured.obj", ""),
        ("meshes/025_Mug_Textured.OBJ", ""),
        ("025_mug_google_16k_textured.obj", "google_16k"),
        ("ycb_025_mug/textured.obj", ""),
    ],
)
def test_layouts(tmp_path: Path, file: str, variant: str) -> None:
    (item,) = find_ycb(make(tmp_path, file))
    assert (item.name, item.mesh, item.variant) == ("025_mug", tmp_path / file, variant)


def test_many_objects_come_by_number(tmp_path: Path) -> None:
    make(
        tmp_path,
        "065-b_cups/tsdf/textured.obj",
        "065-a_cups/google_16k/textured.obj",
        "073_a_lego_duplo.obj",
        "004_sugar_box.obj",
        "004_sugar_box/google_16k/textured.obj",
        "README.md",
    )
    assert meshes(tmp_path) == {
        "004_sugar_box": "004_sugar_box/google_16k/textured.obj",
        "065-a_cups": "065-a_cups/google_16k/textured.obj",
        "065-b_cups": "065-b_cups/tsdf/textured.obj",
        "073-a_lego_duplo": "073_a_lego_duplo.obj",
    }


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    make(
        tmp_path,
        "025_mug.obj",
        "025_mug_vhacd.obj",  # no scan of the object
        "025_mug/collision.obj",
        "025_teapot.obj",
        "024_bowl/clouds/merged_cloud.ply",
        "textured.obj",
        ".cache/024_bowl.obj",
    )
    assert meshes(tmp_path) == {"025_mug": "025_mug.obj"}


@pytest.mark.parametrize("inside", ["003_cracker_box", "003_cracker_box/google_16k"])
def test_the_folder_of_one_object_will_do(
    tmp_path: Path, inside: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(tmp_path, *DOWNLOAD)
    (item,) = find_ycb(tmp_path / inside)
    assert (item.name, item.variant) == ("003_cracker_box", "google_16k")
    monkeypatch.chdir(tmp_path / inside)
    assert find_ycb(".")[0].mesh.resolve() == item.mesh.resolve()


def test_a_set_has_no_published_mass_for_its_parts(tmp_path: Path) -> None:
    (item,) = find_ycb(make(tmp_path, "072-a_toy_airplane/google_16k/textured.obj"))
    assert (item.mass, item.mass_source) == (None, "")


def test_masses_of_six_objects_known_from_elsewhere() -> None:
    grams = {"003": 411, "004": 514, "005": 349, "006": 603, "009": 97, "010": 370}
    assert {n: YCB_MASSES[YCB_NAMES[n]] * 1e3 for n in grams} == pytest.approx(grams)


def test_the_table_holds_together() -> None:
    assert len(YCB_MASSES) == 70
    assert all(find_ycb_name(name) == name for name in YCB_NAMES.values())
    assert all(0.001 <= mass <= 1.2 for mass in YCB_MASSES.values())
    cups = [YCB_MASSES[f"065-{letter}_cups"] for letter in "abcdefghij"]
    assert cups == sorted(cups)  # they nest, a in b in c


def test_a_folder_without_ycb_objects(tmp_path: Path) -> None:
    looked = (
        f"no YCB objects found in {tmp_path} or its subfolders; expected folders such as"
        " 003_cracker_box/google_16k with a textured.obj, or files such as"
        " 003_cracker_box.obj;"
    )
    make(tmp_path, "mug.obj")
    with pytest.raises(InvalidInputError) as caught:
        find_ycb(tmp_path)
    assert str(caught.value) == (
        f"{looked} nothing is downloaded: get the meshes from"
        " https://www.ycbbenchmarks.com/object-models and unpack them there"
    )
    make(tmp_path, "003_cracker_box_google_16k.tgz", "004_sugar_box_google_16k.tgz")
    with pytest.raises(InvalidInputError) as caught:
        find_ycb(tmp_path)
    assert str(caught.value) == (
        f"{looked} there are archives (003_cracker_box_google_16k.tgz and 1 more):"
        " unpack them there"
    )


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError) as caught:
        find_ycb(tmp_path / "ycb")
    assert str(caught.value) == (
        f"{tmp_path / 'ycb'} is not a folder; give the one that the YCB downloads were unpacked in"
    )
