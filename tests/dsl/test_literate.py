"""Bad missions beside the exact report: every Markdown file in `literate/` is a test. Their form:
`kybflow.api.codes`.

Rewrite the reports of a file with: python tests/dsl/test_literate.py NAME.md
"""

from __future__ import annotations

import contextlib
import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))  # where this runs without pytest

from hardware_catalog import HardwareCatalog

from kybflow.api.codes import Section, folder, sections, sections_of, write
from kybflow.core.signals import Battery, Imu
from kybflow.drivers.sim import Sim
from kybflow.dsl.compiler import Result, compile_mission
from kybflow.dsl.diagnostics import render
from kybflow.dsl.resolving.library_files import without_homes
from kybflow.parts.catalog import Catalog, PartSpec, load_catalog

CASES = {f"{case.family}: {case.heading}": case for case in sections()}


_FOUND = re.compile(r"\S+:\d+:\d+ (error|warning)\[KYB\d{3}\]: ")


class Autopilot(Sim):
    simulated = False
    grips = False
    brings = ()
    provides = frozenset({Imu, Battery})


class Lab(Catalog):
    """Everything installed, and the parts that a page has as `lab/KIND/NAME.py`."""

    def __init__(self, place: Path) -> None:
        self._all, self._place = load_catalog(), place
        own: dict[str, dict[str, str]] = {}
        for file in (place / "lab").glob("*/*.py"):
            kind, name = file.parent.name, file.stem
            own.setdefault(kind, {})[name] = f"lab.{kind}.{name}"
        super().__init__(own)

    def names(self, kind: str) -> tuple[str, ...]:
        return (*self._all.names(kind), *super().names(kind))

    def get(self, kind: str, name: str) -> PartSpec:
        if name not in super().names(kind):
            return self._all.get(kind, name)
        sys.path.insert(0, str(self._place))
        try:
            return super().get(kind, name)
        finally:
            sys.path.remove(str(self._place))
            for module in [m for m in sys.modules if m.partition(".")[0] == "lab"]:
                del sys.modules[module]

    def always(self, kind: str) -> tuple[PartSpec, ...]:
        return self._all.always(kind)


def catalog(family: str, place: Path) -> Catalog:
    """Everything installed and the page's own; on hardware also a driver of it."""
    return HardwareCatalog(Autopilot, "autopilot") if family == "On hardware" else Lab(place)


def result_of(case: Section, files: dict[str, str], place: Path) -> Result:
    write(files, place)
    options = dict(a.removeprefix("--").split(" ", 1) for a in case.arguments if "--set" not in a)
    sets = [a.removeprefix("--set ") for a in case.arguments if "--set" in a]
    with contextlib.chdir(place):
        own = catalog(case.family, place)
        return compile_mission("mission.yaml", catalog=own, target=options.get("target"), sets=sets)


def report_of(case: Section, place: Path) -> str:
    result = result_of(case, case.files, place)
    text = "\n\n".join(render(d, result.texts) for d in result.diagnostics) + "\n"
    return without_homes(text)


@pytest.mark.parametrize("name", CASES)
def test_report_is_exactly_this(name: str, tmp_path: Path) -> None:
    assert report_of(CASES[name], tmp_path) == CASES[name].report


def test_every_finding_says_what_to_do() -> None:
    findings = (d for case in CASES.values() for d in case.report.split("\n\n"))
    assert [d for d in findings if _FOUND.match(d) and "      = help: " not in d] == []


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.mend])
def test_the_change_mends_it(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    found = {d.code for d in result_of(case, case.mended(), tmp_path).diagnostics}
    assert found & set(case.codes) == set()


def rewrite(path: Path, scratch: Path) -> None:
    """Write the reports as they are now."""
    text = path.read_text(encoding="utf-8")
    for number, case in enumerate(sections_of(text)):
        new = report_of(case, scratch / f"{path.stem}{number}")
        start = text.index(f"## {case.heading}\n")
        end = text.find("\n## ", start)
        section = text[start : end if end > 0 else len(text)]
        fresh = re.sub(r"(?ms)^```report\n.*?^```$", lambda _, n=new: f"```report\n{n}```", section)
        text = text.replace(section, fresh)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    import tempfile

    for markdown in (folder() / name for name in sys.argv[1:]):
        with tempfile.TemporaryDirectory() as place:
            rewrite(markdown, Path(place))
