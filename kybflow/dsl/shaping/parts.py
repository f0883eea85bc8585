"""A part in its place: `fence`, or `{use: fence, margin: 20 cm}`, judged by that part's own schema
and decoded into its parameters."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any, TypeVar

from kybflow.core.errors import KybflowError
from kybflow.core.params import fields_of
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.document import PartUse
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, describe, items_of
from kybflow.dsl.reading.values import decode
from kybflow.dsl.schema.judge import judge_params

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog, PartSpec

P = TypeVar("P")

CODES = {
    "KYB140": "A part that no installed package offers.",
    "KYB141": "A part that can't be loaded.",
    "KYB142": "Two parts under one name in one list.",
}

_BROKEN = "mend or update the package that offers it"


class PartDecoder:
    """Decodes the uses of parts of one mission; one and the same node is decoded once. `chains` are
    those that could be meant by the name of a behavior."""

    def __init__(self, catalog: Catalog, chains: tuple[str, ...] = ()) -> None:
        self.catalog = catalog
        self._chains = tuple(f"chain.{name}" for name in chains)
        self._done: dict[tuple[str, int], tuple[Node, PartUse | None]] = {}

    def one(
        self, kind: str, node: Node, own: frozenset[str] = frozenset(), word: str = "use"
    ) -> Diagnosed[PartUse | None]:
        """The part that `node` names; `own` are the keys beside the part's parameters. A node that
        several vehicles share is decoded once."""
        key = (kind, id(node))
        if key not in self._done:
            self._done[key] = (node, (yield from self._one(kind, node, own, word)))
        return self._done[key][1]

    def _one(
        self, kind: str, node: Node, own: frozenset[str], word: str
    ) -> Diagnosed[PartUse | None]:
        name = node if isinstance(node, Scalar) else None
        body = Mapping({}, node.span)
        if isinstance(node, Mapping):
            wanted = node.get(word)
            name = wanted if isinstance(wanted, Scalar) else None
            body = _parameters(node, own | ({word, "as"} if word == "use" else {word}))
        if name is None:
            message = f"a part is needed, but this is {describe(node)}"
            if isinstance(node, Mapping):
                message = f"`{word}` is missing"
            yield Diagnostic("KYB102", message, node.span, help=f"write `{word}: NAME`")
            return None
        spec = yield from self.spec(kind, name)
        if spec is None:
            return None
        params = yield from params_of(spec.params, body, spec.name, name.span, own)
        if params is None:
            return None
        label = node.get("as") if isinstance(node, Mapping) and word == "use" else None
        return PartUse(
            name=name.as_text,
            spec=spec,
            params=params,
            label=label.text if isinstance(label, Scalar) else name.text,
            span=node.span if isinstance(node, Scalar) else name.span,
            spans={key: entry.value.span for key, entry in body.entries.items()},
        )

    def spec(self, kind: str, name: Scalar) -> Diagnosed[PartSpec | None]:
        """The part called `name`; None, and a finding, when there is none or it can't be loaded."""
        if name.text not in self.catalog.names(kind):
            more = self._chains if kind == "behaviors" else ()
            meant = f"chain.{name.text}"
            hint = did_you_mean(name.text, (*self.catalog.names(kind), *more))
            if meant in more:
                hint = f"did you mean `{meant}`?"
            message = f"no {kind[:-1]} is called `{name.text}`"
            yield Diagnostic("KYB140", message, name.span, help=hint)
            return None
        try:
            return self.catalog.get(kind, name.text)
        except (KybflowError, ImportError) as error:
            message = f"the {kind[:-1]} `{name.text}` can't be loaded: {error}"
            yield Diagnostic("KYB141", message, name.span, help=_BROKEN)
            return None

    def many(
        self, kind: str, written: Node | None, own: frozenset[str] = frozenset()
    ) -> Diagnosed[tuple[tuple[PartUse, Node], ...]]:
        """The parts of a list, each with its node; their labels differ."""
        uses: list[tuple[PartUse, Node]] = []
        for node in items_of(written):
            use = yield from self.one(kind, node, own)
            if use is None:
                continue
            twin = next((u for u, _ in uses if u.label == use.label), None)
            if twin is not None:
                assert written is not None
                yield _twice(twin, use, written.span)
                continue
            uses.append((use, node))
        return tuple(uses)


def _twice(first: PartUse, second: PartUse, written: Span) -> Diagnostic:
    """KYB142 for two parts of the list `written`; at the one of the list where the other is from a
    stack."""
    message = f"`{second.label}` is in this list twice"
    is_first, is_second = (use.span.is_in(written) for use in (first, second))
    if is_first == is_second:
        notes, hint = (f"first at {first.span.at}",), "give one of them a name of its own"
        return Diagnostic(
            "KYB142", message, second.span, notes=notes, help=f"{hint} with `as: NAME`"
        )
    own, other = (first, second) if is_first else (second, first)
    notes = (f"the stack has it at {other.span.at}",)
    hint = "leave out yours: the stack has it"
    return Diagnostic("KYB142", message, own.span, notes=notes, help=hint)


def params_of(
    cls: type[P], body: Mapping, part: str, head: Span, beside: frozenset[str] = frozenset()
) -> Diagnosed[P | None]:
    """The parameters of `part` as `cls`; None when they have errors. `head` is the place for what
    is missing, `beside` are keys that could be meant too."""
    declaration: Any = cls
    if not body.entries and not _needs_values(declaration):
        return cls()
    fields = fields_of(declaration)
    values: dict[str, Any] = {}
    findings: list[Diagnostic] = []
    for field in fields:
        node = body.get(field.name)
        if node is not None:
            values[field.name], found = collect(decode(node, field))
            findings += found
    said = {finding.span for finding in findings}
    judged = judge_params(Mapping(body.entries, head), cls, part, beside)
    findings += [finding for finding in judged if finding.span not in said]
    yield from findings
    return None if findings else cls(**values)


@functools.cache
def _needs_values(declaration: Any) -> bool:
    return any(field.required for field in fields_of(declaration))


def _parameters(node: Mapping, own: frozenset[str]) -> Mapping:
    entries = {k: e for k, e in node.entries.items() if k not in own}
    return Mapping(entries, node.span)
