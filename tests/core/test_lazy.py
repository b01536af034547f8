from __future__ import annotations

import json
import subprocess
import sys

import pytest

import burg_drake

HEAVY = ("pydrake", "trimesh", "scipy", "embreex", "coacd", "cv2", "yaml", "rich", "pyarrow")


def run(code: str) -> list[str]:
    """Runs code in a fresh interpreter and returns the heavy packages that it has loaded."""
    code += f"\nimport json, sys\nprint(json.dumps([m for m in {HEAVY} if m in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_importing_the_package_and_its_rooms_loads_nothing_heavy():
    rooms = ["core", "objects", "scene", "station", "grasping", "motion", "simulation"]
    rooms += ["visualization", "evaluation", "apps"]
    code = "import burg_drake\ndir(burg_drake)\nburg_drake.__version__\n"
    code += "\n".join(f"import burg_drake.{room}" for room in rooms)
    assert run(code) == []


def test_the_errors_are_there_without_anything_else():
    assert run("from burg_drake import BurgError, Outcome") == []


def test_a_name_is_loaded_on_first_use_and_then_stays():
    code = (
        "import burg_drake\n"
        "assert 'GraspSet' not in vars(burg_drake)\n"
        "from burg_drake.core.grasp_set import GraspSet\n"
        "assert burg_drake.GraspSet is GraspSet\n"
        "assert vars(burg_drake)['GraspSet'] is GraspSet\n"
    )
    assert "pydrake" not in run(code)


def test_unknown_attributes_fail_as_in_any_module():
    assert not hasattr(burg_drake, "no_such_name")
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = burg_drake.no_such_name


def test_every_public_name_exists_where_it_is_announced():
    assert set(burg_drake.__all__) <= set(dir(burg_drake))
    for name in burg_drake.__all__:
        assert getattr(burg_drake, name) is not None, name


def test_faces_are_imported_on_first_use():
    code = "import burg_drake as burg\nassert burg.errors.MeshError\n"
    assert run(code + "assert not {'grasps', 'arm', 'objects'} & set(vars(burg))") == []
