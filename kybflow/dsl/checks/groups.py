"""Groups of vehicles: KYB190."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.arrows import WORDS
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean
from kybflow.dsl.document import Document
from kybflow.dsl.reading.source import Text


def groups(case: Case) -> Iterator[Diagnostic]:
    """KYB190: a group that can't be one.

    Its name is no vehicle's and no word of the language; it has a member at least; each is a
    vehicle of the mission, and named once.
    """
    document = case.document
    for name, members in document.groups.items():
        span = document.group_spans[name]
        if name in document.vehicles:
            message, hint = f"`{name}` is a vehicle already", "give the group another name"
            yield Diagnostic("KYB190", message, span, label="a group", help=hint)
        elif name in WORDS:
            message = f"a group can't be called `{name}`"
            yield Diagnostic("KYB190", message, span, label="a word of the language")
        if not members:
            message = f"the group `{name}` is empty"
            yield Diagnostic("KYB190", message, span, help="name a vehicle, or remove it")
        yield from _members(name, members, document)


def _members(group: str, members: tuple[Text, ...], document: Document) -> Iterator[Diagnostic]:
    first: dict[str, Text] = {}
    for member in members:
        if member.text in first:
            message = f"`{member.text}` is in `{group}` twice"
            yield Diagnostic("KYB190", message, member.span, help="name it once")
        elif member.text not in document.vehicles:
            is_group = member.text in document.groups
            hint = did_you_mean(member.text, document.vehicles)
            if is_group:
                hint = "a group holds vehicles: name each of them"
            message = f"there is no vehicle `{member.text}`"
            label = "a group" if is_group else "unknown"
            yield Diagnostic("KYB190", message, member.span, label=label, help=hint)
        first.setdefault(member.text, member)
