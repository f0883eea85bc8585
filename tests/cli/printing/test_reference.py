"""The reference pages are current and whole: the parts, and every key of the language."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from typer.testing import CliRunner

from kybflow.cli.app import app
from kybflow.cli.printing.parts import page
from kybflow.core.events import BaseEvent
from kybflow.core.params import fields_of
from kybflow.dsl.expressions.tokens import KEYWORDS
from kybflow.dsl.expressions.tree import Function
from kybflow.dsl.language.schema import record_schema
from kybflow.dsl.names.built_in import BUILT_IN as STATES
from kybflow.dsl.plan import Library, Plan
from kybflow.parts.action import BUILT_IN as ACTIONS
from kybflow.parts.catalog import load_catalog, own_catalog
from kybflow.parts.events import AWAITED_EVENTS, ENGINE_EVENTS
from kybflow.parts.observables import OBSERVABLES
from kybflow.world.vehicle_context import Airframe

DOCS = Path(__file__).parents[3] / "docs"
LANGUAGE = (DOCS / "mission-language.md").read_text(encoding="utf-8")
FAILSAFE = (DOCS / "failsafe.md").read_text(encoding="utf-8")


def parts(*arguments: str) -> int:
    return CliRunner().invoke(app, ["parts", *arguments]).exit_code


def keys_of(schema: Any) -> Iterator[str]:
    """Every key that a shape of the language has."""
    if isinstance(schema, list):
        for item in schema:
            yield from keys_of(item)
    elif isinstance(schema, dict):
        yield from schema.get("properties", {})
        for value in schema.values():
            yield from keys_of(value)


def words_of_code(text: str) -> set[str]:
    """The words that stand in code, in the line or fenced."""
    code = re.findall(r"^```.*?^```$|`[^`\n]+`", text, re.MULTILINE | re.DOTALL)
    return {word for piece in code for word in re.findall(r"\w+", piece)}


def rows_of(title: str) -> set[str]:
    """What the first cells of a section's tables name in code."""
    [section] = re.findall(rf"^## {title}\n(.*?)(?=^## |\Z)", LANGUAGE, re.MULTILINE | re.DOTALL)
    cells = re.findall(r"^\| (.*?) \|", section, re.MULTILINE)
    return {word for cell in cells for word in re.findall(r"`(\w+)", cell)}


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
WARNING = {"battery"}
"""Supervisors that warn before they ask for their reaction."""


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


def test_the_language_page_has_every_key() -> None:
    keys = {*keys_of(record_schema(Plan)), *keys_of(record_schema(Library))}
    elsewhere = {field.name for field in fields_of(Airframe)}  # docs/parts.md has them
    elsewhere.update(name for event in AWAITED_EVENTS.values() for name in event.fields)
    assert sorted(keys - elsewhere - words_of_code(LANGUAGE)) == []


def test_the_tables_of_the_language_page_have_their_keys() -> None:
    mission = record_schema(Plan)["properties"]
    assert rows_of("Keys") == mission.keys()
    assert rows_of("A vehicle") == mission["vehicles"]["additionalProperties"]["properties"].keys()


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
        ("run_ended", "the run", "`reason`", "no: the run is over then"),
        ("fault_ended", "a vehicle", "`fault`", "by a callback that logs it"),
        ("landed_hard", "a vehicle", "`onto`, `speed` [m/s]", "no: it is recorded only"),
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
