"""What no document may do: end the process, fill the memory, or wait for another one."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from burg_drake.core import (
    DocumentError,
    FileLimits,
    parse_json,
    parse_plain_yaml,
    parse_yaml_node,
    quote_value,
    read_bytes,
    read_rows,
    read_text,
)

DEEP = FileLimits.document.depth
BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 9)
)
CHAIN = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, 300))


@pytest.mark.parametrize("parse", [parse_yaml_node, parse_plain_yaml])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 100_000, r"d:1: nested more than 64 levels deep"),
        ("a:\n" + "- " * 100_000, r"d:2: nested more than 64 levels deep"),
        ("{a: " * 100_000, r"d:1: nested more than 64 levels deep"),
        ("? " * 100_000, r"d:1: nested more than 64 levels deep"),
        (CHAIN, r"d:64: nested more than 64 levels deep"),
        (BOMB, "d:6: more than 1,000,000 values"),
        ("a: 1\nb: !!python/object/apply:os.system [ls]\n", r"d:2: tag 'tag:yaml.org,2002:python"),
        ("a: !mine 1\n", r"d:1: tag '!mine' is not supported"),
        ("".join(f"%TAG !t{i}! tag:x\n" for i in range(50_000)), "more than 8 %TAG"),
        ("a: &a [*a]\n", r"d:1: alias \*a has no anchor before it"),
    ],
)
def test_yaml_beyond_its_bounds(parse: Callable[[str, str], Any], text: str, said: str) -> None:
    with pytest.raises(DocumentError, match=said) as raised:
        parse(text, "d")
    assert len(str(raised.value)) < 200


@pytest.mark.parametrize("parse", [parse_yaml_node, parse_plain_yaml])
def test_yaml_within_its_bounds(parse: Callable[[str, str], Any]) -> None:
    parse("[" * DEEP + "]" * DEEP, "d")
    parse("a: &a !!str 1\nb: [*a, *a]\nc: ! d\n", "d")


def test_a_second_document_is_refused() -> None:
    with pytest.raises(DocumentError, match="d:2: not valid YAML: a second document begins"):
        parse_yaml_node("a: 1\n---\nb: 2\n", "d")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 100_000, r"d: nested more than 64 levels deep"),
        ('{"a":' * 1000 + "1" + "}" * 1000, r"d: nested more than 64 levels deep"),
        ('["]]]]", ' * 100 + "]" * 100, r"d: nested more than 64 levels deep"),
        ("[" + "1," * 1_000_000 + "1]", "d: more than 1,000,000 values; is it the right file?"),
        ('{"a": 1,\n"b": ' + "9" * 400 + "}", r"d:2: '9+\.\.\.9+' has more digits than the 100"),
        ("9" * 5000, r"d:1: '9+\.\.\.9+' has more digits"),
        ('{"a": 1, "b": {"c": 1, "c": 2}}', r"d: 'c' appears twice"),
        ('{"a": 1,\n"b" 2}', r"d:2: not valid JSON"),
        ('"' * 99, r"d:1: not valid JSON"),
        ("[" * 65 + '"' + '\\"' * 1_000_000 + "\\", r"d: nested more than 64"),
    ],
)
def test_json_beyond_its_bounds(text: str, said: str) -> None:
    with pytest.raises(DocumentError, match=said) as raised:
        parse_json(text, "d")
    assert len(str(raised.value)) < 200


def test_json_within_its_bounds() -> None:
    brackets = '"' + "[" * 1000 + '\\""'
    assert parse_json(brackets, "d") == "[" * 1000 + '"'
    assert parse_json("[" * DEEP + "]" * DEEP, "d")[0] is not None
    assert parse_json("1" * 100, "d") == int("1" * 100)


def test_only_regular_files_of_some_size_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "large").open("wb") as stream:
        stream.truncate(FileLimits.document.size + 1)
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    for place, said in {
        tmp_path: "it is a folder",
        tmp_path / "pipe": "it is a pipe; save it to a file first",
        "/dev/zero": "it is a device; expected a file",
        tmp_path / "large": "it is larger than 16 MiB",
        tmp_path / "binary": "it is not a text file",
        tmp_path / "none": "No such file",
        "a\0b": "it is not a valid path",
    }.items():
        with pytest.raises(DocumentError, match=f"^cannot read .*: {said}"):
            read_text(place)
    (tmp_path / "link").symlink_to(tmp_path / "binary")
    assert read_bytes(tmp_path / "link", 2) == b"\xff\xfe"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1," + "x" * 140_000, "t.csv:2: not valid CSV: field larger than field limit"),
        ('a,b\n1,"2\n3,4\n', "t.csv:3: not valid CSV: unexpected end of data"),
        ('a,b\n1,"2"3\n', "t.csv:2: not valid CSV"),
    ],
)
def test_csv_that_is_none(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(DocumentError, match=said):
        read_rows(path)
    path.write_text('\ufeffa,b\n\n1,"x\ny"\n')
    assert read_rows(path) == [(1, ["a", "b"]), (4, ["1", "x\ny"])]


def test_messages_repeat_little_of_what_is_given() -> None:
    assert quote_value("mug") == "'mug'" and quote_value(1.5) == "1.5"
    for value in ("9" * 10_000, 10**99, [["x" * 1000] * 100] * 100, {"a": {"b": {"c": {}}}}):
        assert len(quote_value(value)) <= 120
