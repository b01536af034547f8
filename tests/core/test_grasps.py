from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import GraspSet, InvalidInputError, UnknownNameError, make_pose, swap_fingers

COLUMNS = ("X_OG", "width", "id", "object", "score")


def poses(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return make_pose(Rotation.random(n, random_state=seed).as_matrix(), rng.normal(size=(n, 3)))


def grasps(n: int = 20, seed: int = 0) -> GraspSet:
    rng = np.random.default_rng(seed)
    columns = {
        "clearance": rng.normal(size=n),
        "rank": rng.integers(-5, 5, n),
        "closed": rng.random(n) < 0.5,
        "instance": rng.choice(["left mug", "größer", ""], n),
    }
    return GraspSet.create(
        poses(n, seed),
        object=rng.choice(["mug", "screwdriver", "größe"], n),
        width=rng.uniform(0, 0.08, n),
        score=np.where(rng.random(n) < 0.3, np.nan, rng.random(n)),
        provenance={"sampler": "test", "opening": (0.0, 0.08), "state": {"inc": 2**127 + 1}},
        columns=columns,
    )


def assert_identical(a: GraspSet, b: GraspSet) -> None:
    assert a.column_names == b.column_names
    for name in ("X_OG", *a.column_names):
        one, two = (g.X_OG if name == "X_OG" else g.column(name) for g in (a, b))
        assert one.dtype.kind == two.dtype.kind and one.shape == two.shape
        if one.dtype.kind == "U":
            assert one.tolist() == two.tolist()
        else:
            assert one.dtype == two.dtype and one.tobytes() == two.tobytes(), name
    assert a.provenance == b.provenance


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_storage_restores_every_bit(tmp_path: Path, suffix: str):
    extreme = grasps(3)
    extreme.width[:] = [5e-324, np.nan, 0.1 + 0.2]
    for i, original in enumerate((grasps(), extreme)):
        original.save(tmp_path / f"{i}{suffix}")
        assert_identical(GraspSet.load(tmp_path / f"{i}{suffix}"), original)
    grasps().select([]).save(tmp_path / f"empty{suffix}")
    empty = GraspSet.load(tmp_path / f"empty{suffix}")
    assert len(empty) == 0 and empty.column_names == grasps().column_names


def test_a_value_for_all_grasps_is_stored_once_and_files_do_not_tell(tmp_path: Path):
    once = GraspSet.create(poses(20), object="größe", score=-0.5, columns={"hand": "panda"})
    full = dataclasses.replace(
        once,
        **{name: once.column(name).copy() for name in ("width", "object", "score")},
        columns={"hand": once.columns["hand"].copy()},
    )
    chosen = np.arange(20) % 3 > 0
    for name, change in {
        "same": lambda g: g,
        "mask": lambda g: g.select(chosen),
        "rows": lambda g: g.select([3, 3, 1]),
        "one": lambda g: g.select([4]),
        "none": lambda g: g.select([]),
        "joined": lambda g: GraspSet.concatenate([g.select(chosen), g]),
        "other": lambda g: GraspSet.concatenate([g, GraspSet.create(poses(2), object="mug")]),
        "swapped": lambda g: g.canonical(),
    }.items():
        sets = [change(once), change(full)]
        assert_identical(*sets)
        for suffix in (".npz", ".h5"):
            paths = [tmp_path / f"{name}_{k}{suffix}" for k in range(2)]
            for grasps, path in zip(sets, paths, strict=True):
                grasps.save(path)
            assert paths[0].read_bytes() == paths[1].read_bytes()
    joined = GraspSet.concatenate([once.select(chosen), once])
    assert {joined.column(name).strides for name in ("width", "object", "score", "hand")} == {(0,)}


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_same_content_same_bytes_on_disk(tmp_path: Path, suffix: str):
    for name in ("a", "b"):
        grasps().save(tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_any_reader_of_hdf5_finds_poses_names_and_columns(tmp_path: Path):
    original = grasps(5)
    original.save(tmp_path / "grasps.h5")
    with h5py.File(tmp_path / "grasps.h5") as file:
        assert file.attrs["format"] == "burg_drake.grasps"
        np.testing.assert_array_equal(file["X_OG"], original.X_OG)
        assert [name.decode() for name in file["object"]] == original.object.tolist()
        assert list(file["columns"]) == ["clearance", "rank", "closed", "instance"]
        assert json.loads(file.attrs["provenance"])["sampler"] == "test"


def test_a_file_of_the_first_version_is_read(tmp_path: Path):
    old = grasps(4)
    header = {"format": "burg_drake.grasps", "version": 1, "provenance": {"n": 4}}
    columns = {name: getattr(old, name) for name in COLUMNS}
    np.savez(tmp_path / "old.npz", header=np.array(json.dumps(header)), **columns)
    read = GraspSet.load(tmp_path / "old.npz")
    np.testing.assert_array_equal(read.X_OG, old.X_OG)
    assert read.provenance == {"n": 4} and not read.columns


def test_another_suffix_is_refused(tmp_path: Path):
    with pytest.raises(InvalidInputError, match=r"ends in '.json'; give .* \.npz or \.h5"):
        grasps().save(tmp_path / "grasps.json")
    assert not list(tmp_path.iterdir())


def test_identifiers_follow_from_object_pose_and_width_only():
    X = poses(4)
    reference = GraspSet.create(X, object="mug", width=0.03)
    assert len(set(reference.id.tolist())) == 4
    same = GraspSet.create(X[::-1], object=["mug"] * 4, width=[0.03] * 4, score=1.0)
    np.testing.assert_array_equal(same.id[::-1], reference.id)
    moved = X.copy()
    moved[:, 0, 3] = np.nextafter(moved[:, 0, 3], 1e9)
    for other in (
        GraspSet.create(X, object="mugs", width=0.03),
        GraspSet.create(X, object="mug", width=0.031),
        GraspSet.create(X, object="mug"),
        GraspSet.create(moved, object="mug", width=0.03),
    ):
        assert not set(other.id.tolist()) & set(reference.id.tolist())


def test_negative_zeros_do_not_make_another_grasp():
    X = np.eye(4)
    minus = X.copy()
    minus[0, 1] = minus[2, 3] = -0.0
    one = GraspSet.create(X, object="mug", width=0.0)
    assert one.id[0] == GraspSet.create(minus, object="mug", width=-0.0).id[0]


def test_create_copies_and_fills():
    X = poses(2)
    made = GraspSet.create(X, object="mug")
    X[:] = 0.0
    assert made.X_OG[0, 3, 3] == 1.0
    assert np.isnan(made.width).all() and np.isnan(made.score).all()
    assert made.object.tolist() == ["mug", "mug"]
    single = GraspSet.create(np.eye(4), object="mug", width=0.02)
    assert len(single) == 1 and single.X_OG.shape == (1, 4, 4)
    assert len(GraspSet.create(np.empty((0, 4, 4)), object="mug")) == 0


def test_select_by_mask_index_slice_and_nothing():
    whole = grasps(10)
    mask = np.arange(10) % 3 == 1
    for index in (mask, [1, 4, 7], slice(1, 8, 3)):
        part = whole.select(index)
        np.testing.assert_array_equal(part.id, whole.id[[1, 4, 7]])
        np.testing.assert_array_equal(part.X_OG, whole.X_OG[[1, 4, 7]])
        assert part.provenance == whole.provenance
    assert whole.select(-1).id.tolist() == [whole.id[-1]]
    assert len(whole.select([])) == len(whole.select(np.zeros(10, bool))) == 0


def test_concatenate_undoes_select():
    whole = grasps(10)
    joined = GraspSet.concatenate(whole.select(slice(i, i + 4)) for i in range(0, 10, 4))
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))
    assert joined.provenance == {"parts": [whole.provenance] * 3}
    for name, values in whole.columns.items():
        np.testing.assert_array_equal(joined.columns[name], values)
    with pytest.raises(InvalidInputError, match="at least one"):
        GraspSet.concatenate([])


def test_what_a_set_lacks_is_missing_in_the_whole():
    some = grasps(2)
    joined = GraspSet.concatenate([GraspSet.create(poses(1), object="mug"), some])
    np.testing.assert_array_equal(joined.columns["rank"], [np.nan, *some.columns["rank"]])
    assert joined.columns["instance"].tolist() == ["", *some.columns["instance"].tolist()]
    other = some.with_columns(instance=1.0)
    with pytest.raises(InvalidInputError, match="'instance' is text in one set"):
        GraspSet.concatenate([some, other])


def test_columns_are_added_replaced_and_found():
    g = grasps(3)
    more = g.with_columns(epsilon=[0.1, 0.2, 0.3], rank=0, score=[3, 2, 1])
    assert more.column_names[:4] == ("width", "id", "object", "score")
    assert more.column("epsilon").tolist() == [0.1, 0.2, 0.3]
    assert more.column("rank").tolist() == [0, 0, 0]
    assert more.score.tolist() == [3.0, 2.0, 1.0] and "score" not in more.columns
    assert "epsilon" not in g.columns and g.columns["rank"].tolist() != [0, 0, 0]
    np.testing.assert_array_equal(more.id, g.id)
    with pytest.raises(UnknownNameError, match=r"no column 'epsilom'; did you mean 'epsilon'\?"):
        more.column("epsilom")
    with pytest.raises(InvalidInputError, match=r"epsilon has shape \(2,\); expected \(3,\)"):
        g.with_columns(epsilon=[1, 2])
    with pytest.raises(InvalidInputError, match="'width' is a part of every grasp"):
        g.with_columns(width=[1, 2, 3])
    with pytest.raises(InvalidInputError, match="values of type object"):
        g.with_columns(rank=[1, None, "x"])


def test_a_set_introduces_itself_in_a_line():
    g = grasps(3).select([0, 1])
    assert repr(GraspSet.create(poses(2), object="mug")) == "GraspSet(2 grasps of mug)"
    assert repr(g).endswith("; columns clearance, rank, closed, instance)")


def test_the_canonical_form_is_the_same_for_both_places_of_the_fingers():
    g = grasps()
    swapped = GraspSet.create(swap_fingers(g.X_OG), object=g.object, width=g.width)
    one, two = g.canonical(), swapped.canonical()
    np.testing.assert_array_equal(one.X_OG, two.X_OG)
    np.testing.assert_array_equal(one.id, two.id)
    assert len(set(one.id.tolist()) & set(g.id.tolist())) not in (0, len(g))
    np.testing.assert_array_equal(one.columns["rank"], g.columns["rank"])
    np.testing.assert_array_equal(one.canonical().id, one.id)


def test_names_of_different_length_are_not_cut_when_joined():
    joined = GraspSet.concatenate(
        [GraspSet.create(np.eye(4), object=o) for o in ("mug", "screwdriver")]
    )
    assert joined.object.tolist() == ["mug", "screwdriver"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"X_OG": np.zeros((2, 3, 3))}, r"X_OG has shape \(2, 3, 3\)"),
        ({"X_OG": np.full((2, 4, 4), np.nan)}, "NaN or infinite"),
        ({"width": [0.1, 0.2, 0.3]}, r"width has shape \(3,\); expected \(2,\) or one value"),
        ({"object": ["a"]}, r"object has shape \(1,\)"),
        ({"score": np.zeros((2, 1))}, r"score has shape \(2, 1\)"),
        (
            {"provenance": {"mesh": object()}},
            "provenance must consist of values that JSON can hold",
        ),
    ],
)
def test_create_refuses_what_does_not_fit(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        GraspSet.create(**{"X_OG": poses(2), "object": "mug", **arguments})


def test_columns_of_unequal_length_are_refused():
    g = grasps(3)
    with pytest.raises(
        InvalidInputError, match=r"GraspSet.score has shape \(2,\); expected \(3,\)"
    ):
        GraspSet(g.X_OG, g.width, g.id, g.object, g.score[:2])


def test_files_that_are_no_grasp_set(tmp_path: Path):
    def message(path: Path) -> str:
        with pytest.raises(InvalidInputError) as caught:
            GraspSet.load(path)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    grasps().save(tmp_path / "good.npz")
    good = (tmp_path / "good.npz").read_bytes()
    grasps().save(tmp_path / "good.h5")
    tree = (tmp_path / "good.h5").read_bytes()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["grasps/transforms"] = poses(3)
    with h5py.File(tmp_path / "torn.h5", "w") as file:
        file.attrs.update(format="burg_drake.grasps", version=2, provenance="{}")
        file["X_OG"] = poses(3)
    strange = {
        "empty": b"",
        "text": b"x,y,z\n",
        "cut": good[: len(good) // 2],
        "damaged": good[:200] + bytes(64) + good[264:],
    }
    for name, data in strange.items():
        (tmp_path / name).write_bytes(data)
        assert message(tmp_path / name).startswith(
            f"{tmp_path / name} is not a grasp set written by burg_drake: "
        )
    np.save(tmp_path / "burg.npy", poses(3))
    np.savez(tmp_path / "other.npz", grasps=poses(3))
    for name in ("burg.npy", "other.npz", "other.h5"):
        assert "is not a grasp set" in message(tmp_path / name)
    assert "no array 'header', only grasps; write it with" in message(tmp_path / "other.npz")
    assert message(tmp_path / "torn.h5").endswith("torn.h5: columns is missing")
    with h5py.File(tmp_path / "kinds.h5", "w") as file:
        file.attrs.update(format="burg_drake.grasps", version=2, provenance="{}")
        file.update({"X_OG": poses(3), "width": np.ones(3), "score": np.ones(3)})
        file.update({"id": np.ones(3), "object": np.ones(3)})
        file.create_group("columns")
    assert "id has values of type float64" in message(tmp_path / "kinds.h5")
    (tmp_path / "cut.h5").write_bytes(tree[: len(tree) // 2])
    assert "truncated" in message(tmp_path / "cut.h5")
    missing = tmp_path / "missing.npz"
    assert message(missing) == f"cannot read {missing}: No such file or directory"


def test_a_newer_version_is_named(tmp_path: Path):
    header = {"format": "burg_drake.grasps", "version": 3, "provenance": {}}
    np.savez(tmp_path / "new.npz", header=np.array(json.dumps(header)), poses=poses(2))
    with pytest.raises(InvalidInputError, match=r"version 3; this release .* version 1 and 2$"):
        GraspSet.load(tmp_path / "new.npz")


def rewritten(path: Path, **changed: object) -> Path:
    """A file of a set with arrays replaced, of either kind."""
    grasps(12).save(path)
    if path.suffix == ".h5":
        with h5py.File(path, "a") as file:
            for name, values in changed.items():
                del file[name]
                if isinstance(values, np.ndarray):
                    file[name] = values.astype("S") if values.dtype.kind == "U" else values
                else:  # a shape, of which nothing is stored
                    file.create_dataset(name, values, "f8", chunks=(1000,))
    else:
        with np.load(path) as data:
            arrays = dict(data)
        for name, values in changed.items():
            many = isinstance(values, tuple)
            arrays[name] = np.broadcast_to(0.0, 1_000_000) if many else values
        np.savez_compressed(path, **arrays)
    return path


def corrupted(index: int, value: float, row: int = 0, column: int = 0) -> np.ndarray:
    X = grasps(12).X_OG
    X[index, row, column] = value
    return X


ids = grasps(12).id


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"X_OG": corrupted(7, np.nan)}, r"X_OG\[7\] has NaN or infinite numbers"),
        ({"X_OG": corrupted(3, np.inf, 1, 3)}, r"X_OG\[3\] has NaN or infinite numbers"),
        ({"X_OG": corrupted(5, 3.0)}, r"X_OG\[5\] is not a rigid transform"),
        ({"X_OG": corrupted(2, 1e200)}, r"X_OG\[2\] is not a rigid transform"),
        ({"X_OG": corrupted(1, 0.5, 3, 3)}, r"X_OG\[1\] has a last row that is not 0 0 0 1"),
        ({"X_OG": np.zeros((12, 3, 4))}, r"X_OG has shape \(12, 3, 4\); expected \(N, 4, 4\)"),
        ({"width": np.full(12, np.inf)}, r"width\[0\] is inf"),
        ({"width": np.full(12, 1e300)}, r"width\[0\] is 1e\+300; give metres"),
        ({"width": (750_000_000,)}, r"width has shape \(\d+,\); expected \(12,\)"),
        ({"id": np.array([*ids[:9], ids[4], *ids[10:]])}, rf"id\[4\] and id\[9\] are .*{ids[4]}"),
        ({"id": np.array([""] * 12)}, r"id\[0\] and id\[1\] are both ''"),
    ],
)
def test_a_file_that_no_set_can_be_of_is_refused(tmp_path, suffix, changed, said):
    path = rewritten(tmp_path / f"a{suffix}", **changed)
    with pytest.raises(InvalidInputError, match=rf"^{path}: {said}"):
        GraspSet.load(path)


def test_a_grasp_may_be_listed_more_than_once(tmp_path: Path):
    several = grasps(4).select([0, 1, 0, 3, 1]).with_columns(instance=list("abcde"))
    unknown = GraspSet.create(np.stack([np.eye(4)] * 2), object="mug")
    for one in (several, unknown):
        one.save(tmp_path / "a.h5")
        assert_identical(GraspSet.load(tmp_path / "a.h5"), one)


def test_texts_of_variable_length_are_read_as_files_of_before_have_them(tmp_path: Path):
    path = tmp_path / "a.h5"
    grasps().save(path)
    with h5py.File(path, "a") as file:
        for name in ("id", "object", "columns/instance"):
            texts = file[name].asstr()[()]
            del file[name]
            file.create_dataset(name, data=texts, dtype=h5py.string_dtype(), compression="gzip")
    loaded = GraspSet.load(path)
    assert loaded.object.tolist() == grasps().object.tolist()
    assert loaded.column("instance").tolist() == grasps().column("instance").tolist()


def test_a_column_that_would_be_a_folder_of_the_file_is_refused(tmp_path: Path):
    odd = grasps().with_columns(**{"a/b": 1.0})
    with pytest.raises(InvalidInputError, match=r"cannot have a column called 'a/b'.*write .npz"):
        odd.save(tmp_path / "a.h5")
    odd.save(tmp_path / "a.npz")
    assert "a/b" in GraspSet.load(tmp_path / "a.npz").column_names
