"""Data sets whose samples are made by the workers of a cluster: the same bytes, whatever fails."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import ClusterError, InvalidInputError, data_root
from burg_drake.dataset import (
    AppearanceSettings,
    DatasetRecipe,
    SampleTask,
    catalogue_scene,
    portable_recipe,
    run_sample_task,
    scene_maker,
)
from burg_drake.evaluation import EvaluationSettings, evaluate, make_bundle, unpack
from burg_drake.objects import write_visual
from burg_drake.scene import SceneRecipe

pytest.importorskip("distributed", reason="the cluster needs burg-drake[dask]")
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

from burg_drake.evaluation import LocalNodes  # noqa: E402

SCENES = ["tabletop_six", "tabletop_close", "tabletop_six"]
RECIPE = DatasetRecipe(views=1, sensor="d435", size=(160, 120), looks=None)
STATION = "panda_tabletop"

sys.path.insert(0, str(Path(__file__).parents[1] / "evaluation"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set that this process has made."""
    made = tmp_path_factory.mktemp("here") / "set"
    found = burg.generate_dataset(SCENES, STATION, made, RECIPE)
    assert found.new == (0, 1, 2) and not found.failed
    return made


@pytest.fixture(scope="module")
def nodes() -> Iterator[LocalNodes]:
    """Two workers."""
    made = LocalNodes(2)
    yield made
    made.close()


def files(folder: Path) -> dict[str, bytes]:
    """Contents of all files of a data set, by name."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


@pytest.mark.thorough
def test_all_files_are_those_of_this_machine(
    folder: Path, nodes: LocalNodes, tmp_path: Path
) -> None:
    there = tmp_path / "set"
    found = burg.generate_dataset(SCENES, STATION, there, RECIPE, cluster=nodes.address)
    assert found.new == (0, 1, 2) and not found.failed
    assert files(there) == files(folder)


@pytest.mark.thorough
def test_scenes_are_sampled_where_they_are_rendered(nodes: LocalNodes, tmp_path: Path) -> None:
    library = burg.load_library("household")
    recipe = replace(RECIPE, sampled=SceneRecipe(library="household", count=2))
    here, there = tmp_path / "here" / "set", tmp_path / "there" / "set"
    burg.generate_dataset(library, STATION, here, recipe, count=1)
    found = burg.generate_dataset(library, STATION, there, recipe, count=1, cluster=nodes.address)
    assert found.new == (0,) and not found.failed
    assert files(there) == files(here)


@pytest.mark.thorough
def test_grasps_of_a_run_travel_and_a_scene_without_any_fails_alone(
    nodes: LocalNodes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import known_judge
    from known_many import empty_pages

    with monkeypatch.context() as patch:
        known_judge.install(patch.setattr)
        empty_pages(patch.setattr)
        settings = EvaluationSettings(grasps_per_object=1)
        evaluate("tabletop_six", STATION, tmp_path / "run", settings=settings, progress=False)
    recipe = replace(RECIPE, run=str(tmp_path / "run"))
    scenes = ["tabletop_close", "tabletop_six"]
    here, there = tmp_path / "here" / "set", tmp_path / "there" / "set"
    local = burg.generate_dataset(scenes, STATION, here, recipe)
    found = burg.generate_dataset(scenes, STATION, there, recipe, cluster=nodes.address)
    assert found.new == (1,) and list(found.failed) == [0]
    assert found.failed == local.failed and "is a run of scene 'tabletop_six'" in found.failed[0]
    assert files(there) == files(here)
    sample = burg.load_dataset(there)[0]
    assert sample.grasps is not None and len(sample.grasps) == 6


def test_a_node_needs_no_file_of_the_user(tmp_path: Path) -> None:
    """Textures, library, station and scene are gone by the time the samples are made."""
    user = tmp_path / "user"
    shutil.copytree(data_root() / "models/household", user / "things")
    box = trimesh.creation.box((0.06, 0.06, 0.1))
    box.visual = trimesh.visual.TextureVisuals(uv=box.vertices[:, :2] * 8.0 + 0.5)
    pixels = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    write_visual(box, user / "things/mug/mesh.obj", image=Image.fromarray(pixels))
    document = replace(burg.load_scene("tabletop_six").document, library="things")
    burg.save_scene(document, user / "mugs.yaml")
    scene, station = burg.load_scene(user / "mugs.yaml"), burg.load_station(STATION)
    recipe = replace(RECIPE, looks=AppearanceSettings(), grasps_per_object=2)
    burg.generate_dataset([scene], station, tmp_path / "set", recipe)
    bundle = make_bundle(catalogue_scene(scene.library, [scene]), station, looks=True)
    shutil.rmtree(user)
    folder = unpack(bundle.data, tmp_path / "node", bundle.name)
    world = replace(bundle, data=b"")
    sent = portable_recipe(recipe, tmp_path / "set")
    made = run_sample_task(SampleTask(world, sent, 0, scene.document, scene.path, None), folder)
    assert made.shard == (tmp_path / "set/shards/000000.tar").read_bytes()
    assert made.entry.filesize == len(made.shard)
    assert [path.name for path in folder.parent.iterdir()] == [bundle.name]


@pytest.mark.thorough
def test_scenes_of_lost_nodes_are_done_elsewhere(folder: Path, tmp_path: Path) -> None:
    """All workers are killed after the first scene, when another one is under way."""
    nodes = LocalNodes(2)
    done = []

    def kill(number: int, error: str) -> None:
        if not done:
            for process in nodes.workers:
                process.kill()
                process.wait()
            nodes.restart_workers()
        done.append(number)

    there = tmp_path / "set"
    try:
        found = burg.generate_dataset(
            SCENES, STATION, there, RECIPE, cluster=nodes.address, progress=kill
        )
    finally:
        nodes.close()
    assert sorted(done) == [0, 1, 2] and found.new == (0, 1, 2) and not found.failed
    assert files(there) == files(folder)


@pytest.mark.thorough
def test_the_same_call_continues_after_the_cluster_was_lost(folder: Path, tmp_path: Path) -> None:
    nodes = LocalNodes(1)

    def kill(number: int, error: str) -> None:
        nodes.scheduler.kill()
        nodes.scheduler.wait()

    there = tmp_path / "set"
    try:
        with pytest.raises(ClusterError, match=r"are kept: .* the same command"):
            burg.generate_dataset(
                SCENES, STATION, there, RECIPE, cluster=nodes.address, progress=kill
            )
    finally:
        nodes.close()
    found = burg.generate_dataset(SCENES, STATION, there, RECIPE, cluster="local:1")
    assert found.known == (0,) and found.new == (1, 2)
    assert files(there) == files(folder)


def test_bad_requests(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "set"
    command = ["dataset", "generate", "--scenes", "tabletop_six", "-o", str(out)]
    assert main([*command, "--cluster", "nowhere"]) == 2
    assert "give local:N, tls://HOST:PORT or a cluster.yaml" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*command, "--cluster", "local:2", "--workers", "2"])
    assert "--workers: not allowed with argument --cluster" in capsys.readouterr().err
    recipe = DatasetRecipe(sampled=SceneRecipe(library="household", count=2), run="run")
    with (
        pytest.raises(InvalidInputError, match="grasps of a run can only be used for given"),
        scene_maker(
            "local:1", 1, recipe, burg.load_library("household"), burg.load_station(STATION)
        ),
    ):
        pass
    assert not out.exists()
