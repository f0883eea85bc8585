"""The tables of keys in `docs/mission-language.md`, one for each record, and the check that none is
missing.

A table is between `<!-- keys: TITLE -->` and `<!-- end -->`, where TITLE is the title of the
record.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from kybflow.core.params import (
    Choice,
    Field,
    ListOf,
    MappingOf,
    Numbers,
    RecordOf,
    ValueType,
    fields_of,
    is_needed,
    type_of,
)
from kybflow.core.units import article
from kybflow.dsl.language.records import AnyOf, PartOf
from kybflow.dsl.plan import Library, Plan
from kybflow.dsl.reading.values import bounds_of, shown_value

_PLACE = re.compile(r"(<!-- keys: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)
_HEAD = "| key | description | value | default |\n|---|---|---|---|"


def records() -> dict[str, Any]:
    """Return every record of the language by its title, outer records first."""
    found: dict[str, Any] = {}
    waiting: list[Any] = [Plan, Library]
    while waiting:
        cls = waiting.pop(0)
        if found.setdefault(cls.title, cls) is cls:
            kinds = [field.type for field in fields_of(cls)]
            others = getattr(cls, "others", None)
            inside = (_innermost(kind) for kind in (*kinds, *([others] if others else [])))
            waiting += [k.cls for k in inside if isinstance(k, RecordOf) and not k.flat]
    return found


def _innermost(kind: ValueType) -> ValueType:
    return _innermost(kind.item) if isinstance(kind, ListOf | MappingOf) else kind


def with_tables(page: Path) -> str:
    """Return the text of a page with its tables filled in. Raises KeyError for an unknown title."""
    known = records()

    def table(match: re.Match[str]) -> str:
        return "\n".join((f"{match[1]}{_HEAD}", *_rows(known[match[2]]), match[3]))

    return _PLACE.sub(table, page.read_text(encoding="utf-8"))


def missing_tables(page: str) -> list[str]:
    """Return the titles of the records for which a page has no table."""
    there = {match[2] for match in _PLACE.finditer(page)}
    return [title for title, cls in records().items() if title not in there and fields_of(cls)]


def _rows(cls: Any) -> Iterator[str]:
    if getattr(cls, "like", ""):
        yield _row("`like`", cls.like, "name", "")
    for field in fields_of(cls):
        if isinstance(field.type, RecordOf) and field.type.flat:
            title = field.type.cls.__name__.lower()
            place = f"[parts](parts.md#{title}s)"
            yield _row("`...`", f"The keys of the {title}, as in {place}.", "", "")
            continue
        is_shown = not field.required and field.default not in (None, (), {}, "")
        is_plain = is_shown and isinstance(field.default, str | int | float | tuple)
        default = f"`{shown_value(field.default, field)}`" if is_plain else ""
        bounds = bounds_of(field)
        value = f"{_words(field.type, field)}, {bounds}" if bounds else _words(field.type, field)
        # a key that `like` may bring is needed too
        needed = is_needed(cls, field) or (field.required and field.needed is None)
        yield _row(f"`{field.key}`", field.help, value, "needed" if needed else default)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _words(kind: ValueType, field: Field) -> str:
    """Return the type of a value in words."""
    if isinstance(kind, Numbers | Choice):
        return type_of(replace(field, type=kind))
    if isinstance(kind, PartOf):
        return f"{article(kind.kind[:-1])} with its parameters"
    if isinstance(kind, ListOf):
        item = kind.item
        if isinstance(item, PartOf):
            return f"a list of {item.kind} with their parameters"
        one = item.cls.title if isinstance(item, RecordOf) else _words(item, field)
        return f"a list of {one}{'' if isinstance(item, Numbers | Choice) else 's'}"
    if isinstance(kind, MappingOf):
        return f"names, each with {_words(kind.item, field)}"
    if isinstance(kind, RecordOf):
        name = article(kind.cls.title)
        return f"{name}, or the name of one" if kind.or_name else name
    return " or ".join(kind.kinds) if isinstance(kind, AnyOf) else kind.shape
