"""Every event of the engine is emitted, and every event of a part is declared."""

from __future__ import annotations

import inspect
import re
from typing import Any, get_args

import pytest
from toolchain import ROOT

from kybflow.core.events import Awaited, BaseEvent, Needs
from kybflow.core.sources import help_of, hints_of
from kybflow.parts.catalog import load_catalog
from kybflow.parts.events import AWAITED_EVENTS, ENGINE_EVENTS, RUN_EVENTS, VEHICLE_EVENTS

KYBFLOW = ROOT / "kybflow"
CONSTRUCTED = re.compile(r"\b([A-Z]\w+)\(")
LITERAL = re.compile(r"\bCustom\(\"")
RAISED = re.compile(r'\b(?:Alarm|_alarm)\(\s*"(\w+)"')
TEXTS = [
    path.read_text(encoding="utf-8")
    for path in KYBFLOW.rglob("*.py")
    if path != KYBFLOW / "parts" / "events.py"
]
RECORDED = (str, float, bool, type(None))
CATALOG = load_catalog()
PARTS = [(kind, name) for kind in CATALOG.kinds() for name in CATALOG.names(kind)]


def test_the_engine_emits_every_event_of_its_page() -> None:
    constructed = {name for text in TEXTS for name in CONSTRUCTED.findall(text)}
    assert [e.name for e in ENGINE_EVENTS.values() if e.__name__ not in constructed] == []


def test_no_event_of_the_engine_is_emitted_by_a_bare_name() -> None:
    assert [text for text in TEXTS if LITERAL.search(text)] == []


def test_an_event_is_of_the_run_or_of_a_vehicle() -> None:
    assert RUN_EVENTS | VEHICLE_EVENTS == AWAITED_EVENTS.keys() < ENGINE_EVENTS.keys()
    assert not RUN_EVENTS & VEHICLE_EVENTS
    assert {"run_started", "input_lost"} <= RUN_EVENTS
    assert {"landed", "part_failed", "camera_lost"} <= VEHICLE_EVENTS
    assert "collided" not in AWAITED_EVENTS


@pytest.mark.parametrize("event", ENGINE_EVENTS.values(), ids=ENGINE_EVENTS)
def test_an_event_has_a_help_and_fields_that_can_be_recorded(event: type[BaseEvent]) -> None:
    assert help_of(event).endswith(".")
    assert event.needs is None or event.needs in get_args(Needs)
    assert event.awaited in get_args(Awaited)
    for field, hint in hints_of(event).items():
        if field in event.fields:
            bare = {kind for part in (hint, *get_args(hint)) for kind in (part, *get_args(part))}
            assert bare & {str, float, bool}, field
            assert all(kind in RECORDED for kind in bare if isinstance(kind, type)), field


@pytest.mark.parametrize(("kind", "name"), PARTS)
def test_a_part_declares_the_events_of_its_alarms(kind: str, name: str) -> None:
    cls: Any = CATALOG.get(kind, name).cls
    raised = set(RAISED.findall(inspect.getsource(inspect.getmodule(cls) or cls)))
    assert raised | {event.name for event in cls.own_events} == set(cls.events)
