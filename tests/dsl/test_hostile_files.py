"""Files that mean harm or are broken: each gets a diagnostic, in bounded time and memory.

What bounded means is measured beside it: so many times the work that a shipped mission of 70 lines
is. The worst of these files is about 25 times that work; what grows with the square of a file's
size is thousands.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from toolchain import MISSIONS

from kybflow.dsl.compiler import Result, compile_mission
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.reading.reader import compose
from kybflow.parts.catalog import load_catalog

ORDINARY = MISSIONS / "formation.yaml"
MOST = 150
"""How many times the work of the ordinary mission a file may be."""
HEAD = b"kybflow: 1\nmission: bad\n"
CYCLE = b"vehicles:\n" + b"".join(b"  v%d: {like: v%d}\n" % (i, i + 1) for i in range(3000))
BOMB = b"a: &a [x,x,x,x,x,x,x,x,x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (c, c, b",".join([b"*%c" % (c - 1)] * 9)) for c in range(98, 112)
)
TEMPLATE = b"".join(b"      s%d: {do: hover, then: s%d}\n" % (i, i) for i in range(900))
WIDE = (
    b"vehicles:\n  a:\n    behaviors:\n"
    + TEMPLATE
    + b"".join(b"  v%d: {like: a}\n" % i for i in range(2000))
)

QUAD = (
    HEAD
    + b"""import: {std: kybflow/airframes}
vehicles: {a: {like: std.mk_quadro, behaviors: {"""
)
FLOWS = (
    HEAD
    + b"""import: {std: kybflow/airframes}
vehicles:
  a: {like: std.mk_quadro, behaviors: {wait: {do: wait_on_ground}, up: {do: take_off, height: 1 m}}}
flows:
"""
    + b"".join(
        b"  f%d: {phases: {one: {run: {a: up}}, two: {run: {a: up}}}}\n" % i for i in range(2000)
    )
)
HOSTILE = {
    "2,000 flows": (FLOWS, "KYB198"),
    "empty": (b"", "KYB005"),
    "only a comment": (b"# nothing\n", "KYB005"),
    "not UTF-8": (b"kybflow: 1\nmission: \xff\xfe\n", "KYB003"),
    "UTF-16": ("kybflow: 1".encode("utf-16"), "KYB003"),
    "a tab": (b"kybflow: 1\nvehicles:\n\ta: 1\n", "KYB004"),
    "a control character": (b"kybflow: \x07\n", "KYB004"),
    "a NUL": (b"kybflow: 1\x00\n", "KYB004"),
    "a 10 MB scalar": (b"mission: " + b"x" * 10_000_000, "KYB002"),
    "a scalar as long as allowed": (HEAD + b"summary: " + b"x" * 1_900_000, "KYB102"),
    "20,000 nested brackets": (b"[" * 20_000, "KYB011"),
    "20,000 nested braces": (b"{a: " * 20_000, "KYB011"),
    "20,000 nested blocks": (b"- " * 20_000, "KYB011"),
    "an alias bomb": (BOMB, "KYB012"),
    "an alias loop": (b"a: &a {b: *a}\n", "KYB013"),
    "an unknown alias": (b"a: *b\n", "KYB013"),
    "two documents": (HEAD + b"---\n" + HEAD, "KYB006"),
    "a Python tag": (HEAD + b"x: !!python/object/apply:os.system ['true']\n", "KYB008"),
    "a tag of its own": (HEAD + b"x: !include /etc/passwd\n", "KYB008"),
    "duplicate keys": (HEAD + HEAD, "KYB007"),
    "a merge key": (HEAD + b"x: {<<: {a: 1}}\n", "KYB009"),
    "a list as a key": (HEAD + b"? [a]\n: 1\n", "KYB010"),
    "NaN": (HEAD + b"hover_limit: .nan\nvehicles: {a: {}}\n", "KYB104"),
    "an infinity": (HEAD + b"hover_limit: .inf\nvehicles: {a: {}}\n", "KYB104"),
    "a number beyond floats": (HEAD + b"hover_limit: 1e999\nvehicles: {a: {}}\n", "KYB104"),
    "a list": (b"- kybflow: 1\n", "KYB102"),
    "a word": (b"kybflow\n", "KYB102"),
    "an import outside": (HEAD + b"import: {a: ../../x.yaml}\nvehicles: {a: {}}\n", "KYB121"),
    "an import with a NUL": (HEAD + b'import: {a: "x\\0y"}\nvehicles: {a: {}}\n', "KYB120"),
    "an import with a huge name": (
        HEAD + b"import: {a: " + b"y" * 900_000 + b"}\nvehicles: {a: {}}\n",
        "KYB120",
    ),
    "a part with a huge name": (
        HEAD + b"vehicles: {a: {behaviors: {x: {do: " + b"y" * 900_000 + b"}}}}\n",
        "KYB140",
    ),
    "a target with a huge name": (
        HEAD
        + b"import: {std: kybflow/airframes}\nvehicles: {a: {like: std.mk_quadro, "
        + b"behaviors: {x: {do: hover, then: "
        + b"y" * 900_000
        + b"}}}}\n",
        "KYB201",
    ),
    "a huge condition": (
        HEAD
        + b"import: {std: kybflow/airframes}\nvehicles: {a: {like: std.mk_quadro, behaviors: "
        + b"{x: {do: take_off, height: 1 m, next: [{go: x, when: "
        + b"(" * 900_000
        + b"}]}}}}\n",
        "KYB214",
    ),
    "a long chain of `like`": (HEAD + CYCLE, "KYB125"),
    "much through `like`": (HEAD + WIDE, "KYB126"),
    "a long circle": (
        QUAD
        + b"up: {do: take_off, height: 1 m, then: s0}, "
        + b"".join(b"s%d: {do: brake, then: s%d}, " % (i, (i + 1) % 2000) for i in range(2000))
        + b"}}}\n",
        "KYB205",
    ),
    "many unknown names": (
        QUAD + b"".join(b"s%d: {do: brake, then: t%d}, " % (i, i) for i in range(2000)) + b"}}}\n",
        "KYB201",
    ),
    "many vehicles in one place": (
        QUAD
        + b"x: {do: wait_on_ground}}}"
        + b"".join(b", v%d: {like: a}" % i for i in range(1000))
        + b"}\n",
        "KYB312",
    ),
    "a million spaces": (HEAD + b"vehicles: " + b" " * 1_000_000 + b"{a: {}}\n", "KYB102"),
    "a huge integer": (HEAD + b"control: " + b"9" * 100_000 + b"\nvehicles: {a: {}}\n", "KYB104"),
    "a huge name": (HEAD + b"vehicles: {" + b"a" * 100_000 + b": {}}\n", "KYB004"),
}

LARGE = {"a long chain of `like`", "many unknown names", "many vehicles in one place"}
"""These take as long as all others."""


def timed(path: Path) -> tuple[Result, float]:
    """What the compiler says of a file, and the processor's seconds for that."""
    catalog = load_catalog()
    begin = time.process_time()
    result = compile_mission(path, catalog=catalog)
    return result, time.process_time() - begin


@pytest.fixture(scope="module")
def ordinary() -> float:
    """The work of the ordinary mission in this process, processor's seconds: the least of three."""
    timed(ORDINARY)
    return min(timed(ORDINARY)[1] for _ in range(3))


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.thorough) if n in LARGE else n for n in HOSTILE],
)
def test_it_is_answered_with_a_diagnostic_in_bounded_time(
    name: str, tmp_path: Path, ordinary: float
) -> None:
    data, code = HOSTILE[name]
    path = tmp_path / "mission.yaml"
    path.write_bytes(data)
    result, work = timed(path)
    assert code in {d.code for d in result.diagnostics}
    assert result.plan is None
    if work > MOST * ordinary:  # another process may have been in the way: the least of three
        work = min(timed(path)[1] for _ in range(2))
    assert work / ordinary < MOST


def test_a_path_that_is_no_file_is_answered(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    unnamed = tmp_path / os.fsdecode(b"bad\xff.yaml")
    unnamed.write_bytes(HEAD)
    nothing, pipe = tmp_path / "none.yaml", tmp_path / "pipe"
    for path in (tmp_path, nothing, Path("/dev/zero"), pipe, Path("a\0b"), unnamed):
        result = compile_mission(path, catalog=load_catalog())
        assert [d.code for d in result.diagnostics] == ["KYB001"], path


def test_a_name_that_is_not_utf8_is_told(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"bad\xff.yaml")
    [found] = compile_mission(path, catalog=load_catalog()).diagnostics
    assert found.message.endswith("is not UTF-8: byte 0xff")
    assert found.help == "rename the file or its folder"


@pytest.mark.thorough
def test_the_process_ends_with_2_and_without_a_traceback(tmp_path: Path) -> None:
    files = []
    for number, (data, _) in enumerate(HOSTILE.values()):
        files.append(tmp_path / f"{number}.yaml")
        files[-1].write_bytes(data)
    done = subprocess.run(
        [sys.executable, "-c", "from kybflow.cli.app import main; main()", "validate", *files],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == ""
    assert "Traceback" not in done.stdout
    assert max(map(len, done.stdout.splitlines())) < 1000


def test_a_file_outside_reached_by_a_link_is_refused(tmp_path: Path) -> None:
    inside = tmp_path / "missions"
    inside.mkdir()
    (tmp_path / "secret.yaml").write_text("library: secret\n")
    (inside / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    mission = inside / "mission.yaml"
    mission.write_bytes(HEAD + b"import: {a: link.yaml}\nvehicles: {a: {}}\n")
    codes = {d.code for d in compile_mission(mission, catalog=load_catalog()).diagnostics}
    assert "KYB121" in codes


def test_a_tab_that_indents_nothing_is_not_blamed() -> None:
    found = Collector()
    compose("a:\t{b: [1, 2}\n", "m.yaml", found)
    assert [d.message for d in found.all] == [
        "the `[` is still open: a `,` or `]` is missing before this"
    ]
