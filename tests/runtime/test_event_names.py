"""Every event that is told has its name where the compiler looks for it."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import pytest

from kybflow.parts.catalog import load_catalog
from kybflow.parts.observables import EVENT_FIELDS, EVENTS, OF_THE_RUN, TOO_LATE

KYBFLOW = Path(__file__).parents[2] / "kybflow"
TOLD = re.compile(r'\btell\(\s*"(\w+)"(?: if [^,]*? else "(\w+)")?|(?:_tell|Finding)\(\s*"(\w+)"')
RAISED = re.compile(r'\b(?:Alarm|_alarm)\(\s*"(\w+)"')
PAGE = (KYBFLOW.parent / "docs" / "mission-language.md").read_text(encoding="utf-8")
CATALOG = load_catalog()
PARTS = [(kind, name) for kind in CATALOG.kinds() for name in CATALOG.names(kind)]


def told_by_the_engine() -> set[str]:
    paths = [*(KYBFLOW / "runtime").rglob("*.py"), *(KYBFLOW / "api").rglob("*.py")]
    texts = [path.read_text(encoding="utf-8") for path in paths]
    return {name for text in texts for names in TOLD.findall(text) for name in names if name}


def test_the_table_has_what_the_engine_tells_and_no_more() -> None:
    assert told_by_the_engine() == set(EVENTS)
    assert set(EVENTS) > OF_THE_RUN
    assert set(EVENTS) > TOO_LATE
    assert set(EVENTS) == set(EVENT_FIELDS)


@pytest.mark.parametrize("name", EVENTS)
def test_the_language_page_has_it_with_what_it_carries(name: str) -> None:
    mark = " *" if name in OF_THE_RUN else ""
    carried = ", ".join(f"`{field}`" for field in EVENT_FIELDS[name])
    assert f"| `{name}`{mark} | {EVENTS[name]} | {carried} |" in PAGE.splitlines()


@pytest.mark.parametrize(("kind", "name"), PARTS)
def test_a_part_declares_the_events_of_its_alarms(kind: str, name: str) -> None:
    cls: Any = CATALOG.get(kind, name).cls
    raised = set(RAISED.findall(inspect.getsource(inspect.getmodule(cls) or cls)))
    assert raised | set(getattr(cls, "tells", ())) == set(cls.events)
