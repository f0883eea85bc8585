"""What holds of every check, and of the walk that several share."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from pathlib import Path
from types import ModuleType

import pytest
from toolchain import ROOT

from kybflow.dsl import checks as package
from kybflow.dsl.checks import checks, checks_in
from kybflow.dsl.checks.reachability import Entries
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog

OWN_CODES = [check for check in checks() if not (check.__doc__ or "").startswith("Every ")]
"""The others tell what the parser of expressions finds, whose codes are its own."""


@pytest.mark.parametrize("check", OWN_CODES, ids=lambda check: check.__name__)
def test_every_check_says_its_code_and_what_it_proves(check: object) -> None:
    assert re.match(r"KYB[1-5]\d\d: [`\w].{20}", check.__doc__ or "", re.DOTALL)


def test_no_code_is_used_twice() -> None:
    codes = [(check.__doc__ or "")[:6] for check in OWN_CODES]
    assert sorted(set(codes)) == sorted(codes)


def test_every_function_with_a_code_is_found() -> None:
    modules = [importlib.import_module(f"{package.__name__}.{m.name}")
               for m in pkgutil.iter_modules(package.__path__)]  # fmt: skip
    functions = [f for m in modules for _, f in inspect.getmembers(m, inspect.isfunction)]
    coded = {f for f in functions if re.match(r"KYB\d{3}: ", f.__doc__ or "")}
    assert coded == set(OWN_CODES)


def test_a_check_is_found_by_its_signature() -> None:
    module = ModuleType("lab_checks")
    source = """
from __future__ import annotations
def no_lab(case: Case) -> Iterator[Diagnostic]: ...
def states(case: Case) -> Iterator[State]: ...
def _helper(case: Case) -> Iterator[Diagnostic]: ...
"""
    exec(source, vars(module))
    assert [check.__name__ for check in checks_in(module)] == ["no_lab"]


@pytest.mark.parametrize(
    "mission", sorted((ROOT / "missions").glob("*.yaml")), ids=lambda p: p.stem
)
def test_the_missions_have_no_findings(mission: Path) -> None:
    assert compile_mission(mission, catalog=load_catalog()).diagnostics == ()


def test_more_entries_than_a_few_count_as_unknown() -> None:
    entries = Entries()
    assert all(entries.add((float(i), 0.0, 0.0)) for i in range(16))
    assert entries.add((99.0, 0.0, 0.0))
    assert not entries.known
    assert not entries.add((98.0, 0.0, 0.0))
    assert len(entries.candidates()) == 17


def test_an_entry_that_is_known_already_changes_nothing() -> None:
    entries = Entries([(1.0, 0.0, 0.0)])
    assert not entries.add((1.0, 0.0, 0.0))
    assert entries.candidates() == [(1.0, 0.0, 0.0)]
