"""The reference pages are current and whole: the parts, and every key of the language."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
from toolchain import ROOT, invoke

from kybflow.cli.printing.reference import page
from kybflow.core.events import BaseEvent
from kybflow.core.params import Field, RecordOf, fields_of
from kybflow.dsl.expressions.tokens import KEYWORDS
from kybflow.dsl.expressions.tree import Function
from kybflow.dsl.language.tables import missing_tables, records, with_tables
from kybflow.dsl.names import BUILT_IN as STATES
from kybflow.parts.action import BUILT_IN as ACTIONS
from kybflow.parts.catalog import load_catalog, own_catalog
from kybflow.parts.events import ENGINE_EVENTS
from kybflow.parts.observables import OBSERVABLES

DOCS = ROOT / "docs"
LANGUAGE = (DOCS / "mission-language.md").read_text(encoding="utf-8")
FAILSAFE = (DOCS / "failsafe.md").read_text(encoding="utf-8")


def parts(*arguments: str) -> int:
    return invoke("parts", *arguments).exit_code


def is_flat(field: Field) -> bool:
    """Whether the keys of another record stand in its place; docs/parts.md has those."""
    return isinstance(field.type, RecordOf) and field.type.flat


def words_of_code(text: str) -> set[str]:
    """The words that stand in code, in the line or fenced."""
    code = re.findall(r"^```.*?^```$|`[^`\n]+`", text, re.MULTILINE | re.DOTALL)
    return {word for piece in code for word in re.findall(r"\w+", piece)}


def supervisors() -> dict[str, list[tuple[str, str]]]:
    """The event and the reaction of each row of the failsafe page's table, by supervisor."""
    found: dict[str, list[tuple[str, str]]] = {}
    table = FAILSAFE.partition("\n| supervisor |")[2].partition("\n\n")[0]
    for row in table.splitlines()[2:]:
        name, _, event, reaction = row.strip("| ").split(" | ")
        found.setdefault(name.strip("`"), []).append((event.strip("`"), reaction.split("`")[1]))
    assert found
    return found


SUPERVISORS = supervisors()
WARNING = {"battery", "mocap_frame"}
"""Supervisors that also warn, before they ask for their reaction or of something else."""


def default_reaction(name: str) -> str:
    fields = own_catalog().get("supervisors", name).fields
    [reaction] = (field.default for field in fields if field.name == "reaction")
    return str(reaction)


def test_the_page_of_parts_is_current() -> None:
    mend = "mend it with: kybflow parts --write docs/parts.md"
    assert (DOCS / "parts.md").read_text(encoding="utf-8") == page(), mend


def test_the_page_has_every_part_of_kybflow_with_its_parameters() -> None:
    text = page()
    for kind in own_catalog().kinds():
        section = text.partition(f"\n## {kind.capitalize()}\n")[2].partition("\n## ")[0]
        for name in own_catalog().names(kind):
            spec = load_catalog().get(kind, name)
            part = section.partition(f"\n### {name}\n")[2].partition("\n### ")[0]
            assert spec.summary in part
            for field in spec.fields:
                assert f"| `{field.name}` | " in part
                assert f" | {field.help} |" in part


def test_the_page_is_written_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "parts.md"
    assert parts("--check", str(file)) == 2
    assert parts("--write", str(file)) == 0
    assert parts("--check", str(file)) == 0
    file.write_text(file.read_text(encoding="utf-8").replace("0.5 m", "0.6 m"), encoding="utf-8")
    assert parts("--check", str(file)) == 2


def test_the_tables_of_the_language_page_are_current() -> None:
    mend = "mend it with: kybflow schema --write docs/mission-language.md"
    assert with_tables(DOCS / "mission-language.md") == LANGUAGE, mend


def test_the_language_page_has_a_table_of_each_record() -> None:
    assert missing_tables(LANGUAGE) == []


@pytest.mark.parametrize("title", records())
def test_the_tables_have_each_key_once_with_its_help(title: str) -> None:
    table = LANGUAGE.partition(f"<!-- keys: {title} -->\n")[2].partition("<!-- end -->")[0]
    for field in fields_of(records()[title]):
        if not is_flat(field):
            [row] = re.findall(rf"^\| `{field.key}` \| .*$", table, re.MULTILINE)
            assert field.help
            assert row.replace("\\|", "|").startswith(f"| `{field.key}` | {field.help} | ")


@pytest.mark.parametrize("event", ENGINE_EVENTS.values(), ids=ENGINE_EVENTS)
def test_the_page_has_every_event_with_its_fields(event: type[BaseEvent]) -> None:
    [row] = re.findall(rf"^\| `{event.name}` \| .*$", page(), re.MULTILINE)
    assert f" | {event.__doc__} | " in row
    assert set(event.fields) <= words_of_code(row)


@pytest.mark.parametrize(
    ("event", "owner", "carries", "awaited"),
    [
        ("body_lost", "a vehicle with motion capture", "`value` [s], `bound` [s]", "yes"),
        ("lap_completed", "`circle`, `figure_eight`", "`behavior`, `lap`", "yes"),
        ("run_ended", "the run", "`reason`", "no: the run has ended"),
        ("fault_ended", "a vehicle", "`fault`", "by a callback that logs it"),
        ("landed_hard", "a vehicle", "`onto`, `speed` [m/s]", "no: it is only recorded"),
    ],
)
def test_the_page_says_whose_an_event_is_its_units_and_who_may_wait_for_it(
    event: str, owner: str, carries: str, awaited: str
) -> None:
    [row] = re.findall(rf"^\| `{event}` \| .*$", page(), re.MULTILINE)
    _, _, whose, _, fields, waits, _ = (cell.strip() for cell in row.split("|"))
    assert (whose, fields, waits) == (owner, carries, awaited)


def test_the_language_page_has_every_word_every_action_and_every_built_in_state() -> None:
    names = {*OBSERVABLES, *get_args(Function), *KEYWORDS, "distance", "separation"}
    names |= {*ACTIONS, *STATES}
    words = words_of_code(LANGUAGE)
    assert [name for name in sorted(names) if not {*name.split(".")} <= words] == []


@pytest.mark.parametrize("name", own_catalog().names("supervisors"))
def test_the_page_of_parts_has_the_alarms_and_the_reaction_of_the_supervisor(name: str) -> None:
    section = page().partition("\n## Supervisors\n")[2].partition("\n## ")[0]
    part = section.partition(f"\n### {name}\n")[2].partition("\n### ")[0]
    alarms = ", ".join(f"`{event}`" for event in own_catalog().get("supervisors", name).cls.events)
    assert f"; default reaction `{default_reaction(name)}`; alarms {alarms}.\n" in part


@pytest.mark.parametrize("name", list(SUPERVISORS))
def test_the_rows_of_the_failsafe_page_are_true_of_the_supervisor(name: str) -> None:
    rows, default = SUPERVISORS[name], default_reaction(name)
    assert {event for event, _ in rows} == {*own_catalog().get("supervisors", name).cls.events}
    assert {reaction for _, reaction in rows} == {default, *(["warn"] if name in WARNING else [])}
