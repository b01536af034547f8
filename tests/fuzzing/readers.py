"""Every reader of files of this project, with a sound file to damage."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh

from burg_drake.cameras import (
    load_intrinsics,
    load_placement,
    read_depth,
    read_image,
    read_poses as read_recorded_poses,
)
from burg_drake.core import BurgError, GraspSet, data_root, load_document, make_pose
from burg_drake.evaluation import (
    RunDocument,
    hand_of,
    is_table,
    read_journal,
    read_origin,
    read_table,
    read_trial,
    table_row,
    write_table,
)
from burg_drake.formats import (
    GRASP_FORMATS,
    PANDA_GRIPPER,
    format_of,
    object_description,
    read_burg_library,
    read_burg_scene,
    read_grasp_file,
    read_poses,
)
from burg_drake.motion import ArmLimits, Plan, PlanOrigin, Trajectory, load_plan
from burg_drake.objects import load_library, read_mesh
from burg_drake.pipeline import load_recipe, read_record
from burg_drake.scene import load_scene
from burg_drake.station import load_hand, load_station

EXAMPLES = Path(__file__).parent / "examples"

MESHES = ("obj", "ply", "stl", "off", "glb")


@dataclass(frozen=True)
class Reader:
    """A reader, and what it reads.

    Attributes:
        name: of the reader.
        file: name of the file that it reads; the suffix is its kind for `damage.damaged`.
        read: reads it.
        make: makes a sound one.
        share: of the files that a reader gets on average; those that take long get fewer.
    """

    name: str
    file: str
    read: Callable[[Path], Any]
    make: Callable[[Path], Any]
    share: float = 1.0

    @property
    def kind(self) -> str:
        """How the file can be damaged."""
        return {"yml": "yaml", "hdf5": "h5"}.get(suffix := self.file.rpartition(".")[2], suffix)


def grasps() -> GraspSet:
    """Five grasps that every format can hold."""
    rng = np.random.default_rng(0)
    return GraspSet.create(
        make_pose(p_AB=rng.uniform(-0.1, 0.1, (5, 3))),
        object="mug",
        width=rng.uniform(0.0, 0.08, 5),
        score=[1.0, 0.0, 1.0, 1.0, 0.0],
        columns={"slip": np.arange(5.0)},
        provenance={
            "scene": "two.yaml",
            "hand": {"name": "panda_hand", "document": "panda_hand.yaml"},
            "object_files": {"mug": {"file": "mug.obj", "scale": 1.0, "com": [0.0, 0.0, 0.1]}},
            "parts": [{"seed": 1, "hand": {"name": "panda_hand"}}],
        },
    )


def _read_grasps(format: str, path: Path) -> None:
    """Also what is asked of a set that was read, and whether it can be written."""
    for chosen in (format, None):
        found = read_grasp_file(path, chosen).grasps
        hand_of(found)
        for name in set(found.object.tolist()):
            object_description(found, name)
        found.save(path.with_name("again.npz"))


def _recognise(path: Path) -> None:
    is_table(path)
    format_of(path)


def _read_rows(path: Path) -> None:
    columns = read_table(path)
    for i in range(len(next(iter(columns.values()), ()))):
        row = table_row(columns, i)
        read_trial(row, f"{path}: row {i + 1}")
        read_origin(row, f"{path}: row {i + 1}")


def _copied(source: Path) -> Callable[[Path], Any]:
    return partial(shutil.copyfile, source)


def _example(name: str) -> Callable[[Path], Any]:
    return _copied(EXAMPLES / name)


def _scene(path: Path) -> None:
    shutil.copyfile(data_root() / "scenes" / "tabletop_six.yaml", path)


def _write_image(path: Path) -> None:
    cv2.imwrite(str(path), np.arange(192, dtype=np.uint8).reshape(8, 8, 3))


def _plan(path: Path) -> Path:
    """Beside a CSV is what it is for."""
    parts = [Trajectory.rest(np.array([0.1, -0.2]), 0.01, 500.0) for _ in range(3)]
    limits = ArmLimits(*(np.full(2, x) for x in (-3.0, 3.0, 1.0, 4.0, 80.0, np.inf)))
    origin = PlanOrigin(("a", "b"), limits, "st", "12", "sc", "34", "mug", np.eye(4))
    plan = Plan(*parts, close_time=0.01, opening=0.08, width=0.03, origin=origin)
    (plan.to_csv if path.suffix == ".csv" else plan.to_json)(path)
    return path


def _plan_beside(path: Path) -> None:
    _plan(path.with_name(path.name.removesuffix("-metadata.json")))


def _load_plan_beside(path: Path) -> None:
    load_plan(path.with_name(path.name.removesuffix("-metadata.json")))


READERS: tuple[Reader, ...] = (
    *(
        Reader(
            f"grasps {name}",
            f"a{format.suffixes[0]}",
            partial(_read_grasps, name),
            partial(lambda format, path: format.write(grasps(), path, PANDA_GRIPPER), format),
        )
        for name, format in GRASP_FORMATS.items()
    ),
    Reader("grasps npz", "a.npz", partial(_read_grasps, "burg_drake"), grasps().save),
    Reader("recognition", "a.dat", _recognise, lambda path: grasps().save(path.with_suffix(".h5"))
           or path.with_suffix(".h5").rename(path)),
    Reader("pose", "a.yaml", lambda path: read_poses([str(path)]), _example("pose.yaml")),
    Reader("poses", "a.npy", lambda path: read_poses([f"{path}:1"]),
           lambda path: np.save(path, np.tile(np.eye(4), (3, 1, 1)))),
    Reader("scene", "a.yaml", load_scene, _scene),
    Reader("station", "a.yaml", load_station,
           _copied(data_root() / "stations" / "panda_tabletop.yaml")),
    Reader("hand", "a.yaml", lambda path: load_hand(str(path)),
           _copied(data_root() / "models" / "hands" / "wsg_50.yaml")),
    Reader("library", "library.yaml", lambda path: load_library(path.parent),
           _copied(data_root() / "models" / "household" / "library.yaml"), 0.3),
    Reader("recipe", "a.yaml", load_recipe, _example("objects.yaml")),
    Reader("build record", "build.json", lambda path: read_record(path.parent),
           _copied(data_root() / "models" / "household" / "mug" / "build.json")),
    Reader("intrinsics", "a.yaml", load_intrinsics, _example("intrinsics.yaml")),
    Reader("camera info", "a.yaml", load_intrinsics, _example("camera_info.yaml")),
    Reader("camera message", "a.yaml", load_intrinsics, _example("message.yaml")),
    Reader("opencv", "a.yaml", load_intrinsics, _example("opencv.yaml")),
    Reader("placement", "a.yaml", load_placement, _example("placement.yaml")),
    Reader("recorded poses", "a.csv", read_recorded_poses, _example("poses.csv")),
    Reader("depth", "a.npy", read_depth, lambda path: np.save(path, np.ones((4, 6), np.float32))),
    Reader("image", "a.png", read_image, _write_image),
    Reader("run", "a.yaml", lambda path: load_document(path, RunDocument), _example("run.yaml")),
    Reader("results", "a.csv", _read_rows, _example("results.csv")),
    Reader("parquet", "a.parquet", _read_rows,
           lambda path: write_table(path, read_table(EXAMPLES / "results.csv"), {"a": 1})),
    Reader("plan", "a.json", load_plan, _plan, 0.5),
    Reader("plan csv", "a.csv", load_plan, _plan, 0.5),
    Reader("plan beside", "a.csv-metadata.json", _load_plan_beside, _plan_beside, 0.5),
    Reader("journal", "a.jsonl", read_journal, _example("journal.jsonl")),
    Reader("burg library", "a.yaml", read_burg_library, _example("burg_library.yaml")),
    Reader("burg scene", "a.yaml", read_burg_scene, _example("burg_scene.yaml")),
    *(
        Reader(f"mesh {suffix}", f"a.{suffix}", read_mesh,
               lambda path: trimesh.creation.box((0.05, 0.04, 0.06)).export(path), 0.5)
        for suffix in MESHES
    ),
)  # fmt: skip
"""All of them."""


def failure(reader: Reader, path: Path) -> str | None:
    """What is wrong with how a file is read; None if it is read, or refused in one line that names
    it."""
    try:
        reader.read(path)
    except BurgError as error:
        text = str(error)
        if "\n" in text or len(text) > 2000:
            return f"a message of several lines, or a long one: {text[:300]!r}"
        if path.name not in text and str(path.parent) not in text:
            return f"a message that does not name the file: {text[:300]!r}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:300]!r}"
    return None
