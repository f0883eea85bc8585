"""Figures for papers: their width, fonts and colours, and what is said if one can't be drawn."""

from __future__ import annotations

import re
import sys
from itertools import combinations
from pathlib import Path

import pytest
from toolchain import invoke, with_library

import kybflow
from kybflow.api.figures import _COLOURS, FIGURES, write_figure

MISSION = """\
kybflow: 1
mission: two
import: {std: library/airframes.yaml}
world:
  fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}
  obstacles: {post: {cylinder: {at: [1, 0, 0], radius: 10 cm, height: 1 m}}}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up: {do: take_off, height: 60 cm, then: hold}
      hold: {do: hover, for_time: 2 s, then: down}
      down: {do: land}
  b: {like: a, start: {at: [0, 1, 0]}}
"""
TYPE_3, TRUE_TYPE, WIDTH = rb"/Type3", rb"/FontFile2", rb"/MediaBox \[ 0 0 (\S+)"

EACH = [
    "path",
    *(pytest.param(n, marks=pytest.mark.thorough) for n in FIGURES if n not in ("path", "objects")),
]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> kybflow.Run:
    folder = with_library(tmp_path_factory.mktemp("figures"))
    (folder / "two.yaml").write_text(MISSION)
    return kybflow.run(folder / "two.yaml", out=folder / "run")


@pytest.mark.parametrize("name", EACH)
def test_a_figure_is_as_wide_as_a_column_and_embeds_its_fonts(
    name: str, run: kybflow.Run, tmp_path: Path
) -> None:
    for vehicles in ["a"], ["a", "b"]:
        out = tmp_path / f"{len(vehicles)}.pdf"
        write_figure(run, name, out, vehicles=vehicles)
        page = out.read_bytes()
        assert re.findall(WIDTH, page) == [b"252"]  # 3.5 in, of 72 points each
        assert re.search(TRUE_TYPE, page)
        assert not re.search(TYPE_3, page)


def test_a_span_of_time_is_drawn_as_wide_as_the_page(run: kybflow.Run, tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.pdf", tmp_path / "part.pdf"
    write_figure(run, "position", whole, wide=True)
    write_figure(run, "position", part, wide=True, span=(2.0, 2.5))
    assert [float(width) for width in re.findall(WIDTH, whole.read_bytes())] == [515.52]
    assert len(part.read_bytes()) < 0.9 * len(whole.read_bytes())


def test_the_first_colours_differ_in_grey_too() -> None:
    def brightness(colour: str) -> float:
        red, green, blue = bytes.fromhex(colour.removeprefix("#"))
        return 0.299 * red + 0.587 * green + 0.114 * blue

    found = [brightness(colour) for colour in _COLOURS[:4]]
    assert min(abs(a - b) for a, b in combinations(found, 2)) > 35.0


def test_the_command_lists_and_writes_figures(run: kybflow.Run, tmp_path: Path) -> None:
    folder = str(run.folder)
    assert all(name in invoke("figure", folder).stdout for name in FIGURES)
    done = invoke(
        "figure", folder, "error", "--pdf", "--vehicle", "a", "--from", "1s", "--to", "4s"
    )
    assert done.stdout.split() == [str(run.folder / "error.pdf")]
    assert (run.folder / "error.pdf").is_file()
    for suffix in ("svg", "png"):
        out = tmp_path / f"error.{suffix}"
        assert invoke("figure", folder, "error", "--out", str(out)).exit_code == 0
        assert out.is_file()


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["eror"], "there is no figure `eror`; did you mean `error`?"),
        (["error", "--vehicle", "c"], "has no vehicle `c`; known here: `a`, `b`"),
        (["error", "--out", "error.gif"], "`error.gif` should end with .pdf, .svg or .png"),
        (["error", "--from", "1 min"], "the recording has no ticks of each vehicle in this time"),
        (["objects"], "the run has nothing that this figure shows"),
        (["error", "--out", "nowhere/error.pdf"], "`nowhere/error.pdf` can't be written"),
    ],
)
def test_what_cannot_be_drawn_is_told(words: list[str], answer: str, run: kybflow.Run) -> None:
    done = invoke("figure", str(run.folder), *words)
    assert done.exit_code != 0
    assert answer in done.stderr


def test_an_install_without_matplotlib_says_what_to_install(
    run: kybflow.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = invoke("figure", str(run.folder), "error")
    assert "a figure needs matplotlib: pip install 'kybflow[figures]'" in done.stderr
    assert done.exit_code == 1
