"""What Blender is given: against what rays meet, and files as it reads them."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import Intrinsics
from burg_drake.dataset import (
    BACKGROUND_GREY,
    NO_APPEARANCE_COLOR,
    Appearance,
    DirectedLight,
    SceneRenderer,
    TableSurface,
    blend_over_background,
    make_blender_scene,
    painted_surfaces,
)
from burg_drake.station import visible_surfaces


def test_surfaces_are_those_that_rays_meet() -> None:
    """The same triangles in the same places; of all that a station has, with its arm."""
    rendered = SceneRenderer("tabletop_six", "panda_tabletop", arm=True, renderer="blender")
    built = rendered._built
    corners: dict[str, list[np.ndarray]] = {}
    for one in painted_surfaces(built.plant, built.scene_graph, linear=False):
        corners.setdefault(one.body, []).append(one.vertices[one.faces])
        assert one.normals is None or one.normals.shape == one.vertices.shape
    rays: dict[str, list[np.ndarray]] = {}
    for seen in visible_surfaces(built.plant, built.scene_graph):
        rays.setdefault(str(int(seen.body)), []).append(seen.vertices[seen.faces])
    assert corners.keys() == rays.keys() and len(rays) > 15
    for body, triangles in rays.items():
        ours, theirs = (
            np.sort(np.concatenate(some).mean(axis=1).round(7), axis=0)
            for some in (corners[body], triangles)
        )
        assert np.allclose(ours, theirs, atol=2e-7)


def test_files_of_a_scene(tmp_path: Path) -> None:
    look = Appearance(
        lights=(DirectedLight(direction=(0.0, 0.0, -1.0), irradiance=0.5),),
        room=3,
        room_light=0.4,
        table=TableSurface(pattern="wood", seed=1),
    )
    rendered = SceneRenderer("tabletop_six", "panda_tabletop", appearance=look, renderer="blender")
    scene = make_blender_scene(rendered._built, look)
    scene.write(tmp_path, threads=2)
    described = json.loads((tmp_path / "scene.json").read_text())
    arrays = np.load(tmp_path / "meshes.npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "environment.hdr", "meshes.npz", "scene.json", "texture_0.png",
    ]  # fmt: skip
    assert cv2.imread(str(tmp_path / "environment.hdr"), cv2.IMREAD_UNCHANGED).dtype == np.float32
    (textured,) = (k for k, one in enumerate(described["parts"]) if one["material"]["texture"])
    assert arrays[f"part_{textured}.uv"].shape == (len(arrays[f"part_{textured}.vertices"]), 2)
    assert described["lamps"][0]["irradiance"] == pytest.approx(0.5 * np.pi)
    assert all(len(arrays[f"part_{k}.faces"]) for k in range(len(described["parts"])))


def test_colors_are_linear_where_drakes_shading_is(tmp_path: Path) -> None:
    built = SceneRenderer("tabletop_six", "panda_tabletop", renderer="blender")._built
    first = {
        linear: painted_surfaces(built.plant, built.scene_graph, linear=linear)[0].material.color
        for linear in (True, False)
    }
    assert first[True] == (0.82, 0.79, 0.74, 1.0)
    assert first[False] == pytest.approx((0.638, 0.587, 0.507, 1.0), abs=1e-3)


def test_what_is_behind_is_mixed_in_linear_light() -> None:
    color = np.zeros((1, 3, 4), np.uint8)
    color[0, :, 3] = (255, 0, 128)
    camera = Intrinsics(width=3, height=1, focal=(3.0, 3.0), center=(1.0, 0.0))
    found = blend_over_background(color, np.eye(4), camera, None)
    assert found[0, 0].tolist() == [0, 0, 0] and found[0, 1].tolist() == list(NO_APPEARANCE_COLOR)
    half = 255.0 * (
        (NO_APPEARANCE_COLOR[0] / 255.0 + 0.055) / 1.055 * 0.498 ** (1 / 2.4) * 1.055 - 0.055
    )
    assert found[0, 2, 0] == pytest.approx(half, abs=1.0)
    assert (
        blend_over_background(color, np.eye(4), camera, Appearance())[0, 1].tolist()
        == [BACKGROUND_GREY] * 3
    )
