"""Ways to damage files, which the tests and `benchmarks/fuzz.py` share.

Every choice is drawn from a `random.Random`: that of a seed, or one that hypothesis supplies, which
then makes failures small.
"""

from __future__ import annotations

import copy
import csv
import io
import json
from pathlib import Path
from random import Random
from typing import Any

import h5py
import numpy as np
import yaml

VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 10**9, -(10**30), 10**400, 0.5, -0.0, 1e-320, 1e308,
    float("nan"), float("inf"), "", " ", "a", "é\u2028\0", "nan", "1e999", "0x10", "1_000",
    "~nosuchuser/x", "../../x", "/", "/dev/zero", "package://burg_drake/", "a" * 5000, [], {},
    [[]], [None], {"a": {"b": 1}}, [1, 2, 3], ["a", "b"], {"": None}, [0.0] * 16,
)  # fmt: skip
"""What stands in the place of a value; some of it is right there, most of it is not."""

TEXTS = (
    "[" * 300, "{a: " * 300, "&a [*a]", "*b", "!!python/object:os.system x", "!!binary x",
    "? [a]\n", "<<: {a: 1}\n", "\t", "- ", ": ", "---\n", "...\n", "%YAML 9.9\n", "\ufeff", "\0",
    "\x85", '"',
    "'", "{", "}", "]", ",", "\n", "9" * 5000, "-", "e", ".", "nan", "1e400", "#", "|\n", "\\u0000",
    "&x [a, a]\nb: &y [*x, *x]\nc: &z [*y, *y]\n", "'" + "x" * 140_000,
)  # fmt: skip
"""What is put into a text."""

ARRAYS: tuple[Any, ...] = (
    np.zeros(0), np.zeros(()), np.full(5, np.nan), np.full((5, 4, 4), np.inf), np.zeros((5, 4, 4)),
    np.tile(np.eye(4), (5, 1, 1)), np.ones(5, bool), np.arange(5), np.arange(5, dtype="u1"),
    np.ones(5, "c16"), np.ones(5, "f2"), np.ones(5, ">f4"), np.array(["a"] * 5),
    np.array([b"\xff"]), np.zeros(5, [("a", "f8")]), np.zeros((2, 17)), np.full((2, 17), 1e300),
    np.zeros((3, 14)),
    np.zeros(5, "M8[s]"), np.float64(1e308), np.array("x"), np.array(10**18), np.zeros((1,) * 32),
)  # fmt: skip
"""What stands in the place of an array."""


def damaged(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    """A file's content with one to three things changed.

    Args:
        content: of a sound file.
        kind: `yaml`, `json`, `csv`, `npy`, `npz`, `h5` or anything else, which decides how it can
            be changed besides its bytes.
        random: decides what happens.
        folder: for temporary files.
    """
    change = {"yaml": _tree, "json": _tree, "csv": _cells, "npy": _npy, "npz": _npz, "h5": _h5}
    for _ in range(random.randint(1, 3)):
        ways = [_bytes]
        if kind in change:
            ways += [change[kind]] * 3
        if kind in ("yaml", "json", "csv"):
            ways += [_text]
        try:
            content = random.choice(ways)(content, kind, random, folder)
        except Exception:
            content = _bytes(content, kind, random, folder)  # no longer of its kind
    return content


def _bytes(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    if not content:
        return bytes([random.randrange(256)])
    i, j = sorted(random.randrange(len(content) + 1) for _ in range(2))
    way = random.randrange(6)
    if way == 0:
        return content[:i]
    if way == 1:
        return content[:i] + content[j:]
    if way == 2:
        return content[:j] + content[i:]
    if way == 3:
        return content[:i] + bytes(random.choice((0, 255)) for _ in range(8)) + content[i + 8 :]
    many = bytearray(content)
    for _ in range(random.choice((1, 4, 16))):
        many[random.randrange(len(many))] = random.choice((0, 1, 127, 128, 255, 45, 48, 57, 91))
    return bytes(many)


def _text(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    text = content.decode()
    i = random.randrange(len(text) + 1)
    return (text[:i] + random.choice(TEXTS) + text[i + random.choice((0, 0, 1, 5)) :]).encode()


def _tree(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    """A document whose tree is changed in one place."""
    tree = json.loads(content) if kind == "json" else yaml.safe_load(content)
    holder = {"root": tree}
    places: list[tuple[Any, Any]] = [(holder, "root")]
    for parent, key in places:  # grows while it is gone through
        value = parent[key]
        if isinstance(value, dict):
            places += [(value, name) for name in value]
        elif isinstance(value, list):
            places += [(value, k) for k in range(min(len(value), 30))]
    parent, key = random.choice(places)
    way = random.randrange(6)
    if way == 0 and parent is not holder:
        del parent[key]
    elif way == 1:
        parent[key] = [parent[key]]
    elif way == 2 and isinstance(parent, dict) and parent is not holder:
        parent[random.choice(["", "a", "version", "x" * 300, "."])] = parent.pop(key)
    elif way == 3 and isinstance(parent, list):
        parent.insert(key, copy.deepcopy(random.choice(parent)))
    elif way == 4:
        _, other = random.choice(places), random.choice(places)
        parent[key] = copy.deepcopy(other[0][other[1]])
    else:
        parent[key] = copy.deepcopy(random.choice(VALUES))
    if kind == "json":
        return json.dumps(holder["root"]).encode()
    return yaml.safe_dump(holder["root"], sort_keys=False, allow_unicode=True).encode()


def _cells(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    rows = list(csv.reader(io.StringIO(content.decode())))
    row = random.choice(rows)
    k = random.randrange(len(row))
    way = random.randrange(4)
    if way == 0:
        del row[k]
    elif way == 1:
        row.append(row[k])
    else:
        row[k] = str(random.choice(VALUES))
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue().encode()


def _npy(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    values = np.load(io.BytesIO(content), allow_pickle=False)
    stream = io.BytesIO()
    if random.random() < 0.5 and values.size:
        values = values.copy()
        values.flat[random.randrange(values.size)] = random.choice((np.nan, np.inf, -1, 1e30, 2))
    else:
        values = random.choice(ARRAYS)
    np.save(stream, values)
    return stream.getvalue()


def _npz(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        arrays = dict(file)
    name = random.choice(list(arrays))
    if name == "header" and random.random() < 0.8:
        text = _tree(str(arrays[name]).encode(), "json", random, folder).decode()
        arrays[name] = np.array(text)
    elif random.random() < 0.3:
        arrays[random.choice(["column:a", "column:", "X_OG", "x"])] = arrays.pop(name)
    else:
        arrays[name] = random.choice(ARRAYS)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def _h5(content: bytes, kind: str, random: Random, folder: Path) -> bytes:
    path = folder / "damaged.h5"
    path.write_bytes(content)
    with h5py.File(path, "a") as file:
        names: list[str] = []
        file.visit(names.append)
        name = random.choice(names)
        way = random.randrange(8)
        if way == 0 and len(file.attrs):
            key = random.choice(list(file.attrs))
            given = file.attrs[key]
            if isinstance(given, str) and given.startswith("{") and random.random() < 0.8:
                file.attrs[key] = _tree(given.encode(), "json", random, folder).decode()
            else:
                file.attrs[key] = random.choice(("", "{}", 1, -1.5, [1, 2], b"\xff", "[]"))
        elif way == 1:
            file.move(name, f"{name}_{random.choice('ab')}")
        else:
            del file[name]
            if way == 2:
                file.create_group(name)
            elif way == 3:
                file[name] = random.choice((h5py.SoftLink("/"), h5py.ExternalLink("a.h5", "/x")))
            elif way == 4:
                file[name] = random.choice((h5py.Empty("f8"), "text", ["a"] * 5, 5, 1e300))
            elif way == 5:
                shape = random.choice(((5,), (10**9,), (5, 4, 4), (10**8, 4, 4), ()))
                file.create_dataset(name, shape, random.choice(("f8", "S9", "i4", "f2")))
            elif way > 5:
                values = random.choice(ARRAYS)
                file[name] = values.astype("S") if values.dtype.kind == "U" else values
    return path.read_bytes()
