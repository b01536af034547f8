"""Scenes sampled from a library: one, the same again, and a folder of some more."""

from __future__ import annotations

import tempfile

import burg_drake as burg

recipe = burg.SceneRecipe(
    library="household", count=4, only=("box", "can", "mug", "bottle"), layout="close", settle=False
)
sampled = burg.sample_scene(recipe)
print(sampled.accepted, "in attempt", sampled.attempts, "with", list(sampled.scene.instances))

again = burg.sample_scene(recipe)
print("the same again:", again.scene.document == sampled.scene.document)

library, station = burg.load_library("household"), burg.load_station("panda_tabletop")
with tempfile.TemporaryDirectory() as folder:
    found = burg.sample_scenes(recipe, library, station, folder, 5)
    print([row.attempts for row in found.rows.values()], "attempts a scene")
