"""The arrows inside of a chain, which lead to the states of one use of it, or out of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence

CODES = {
    "KYB158": "A chain whose arrow, or `begin`, names a state that it does not have.",
    "KYB161": "An arrow to `end` in a chain whose use does not say what follows.",
}
END = "end"
"""The goal that leaves a chain."""


class Arrows(NamedTuple):
    """Those of one use of a chain: the state that is the use, the goal that follows its end (None
    where nothing says it), the behaviors of the chain."""

    state: str
    end: Node | None
    behaviors: Collection[str]
    found: list[Diagnostic]

    def of(self, body: Mapping) -> Mapping:
        """A state of the chain whose arrows go to the states of the use. A `then: end` is left out:
        the `then` of the use holds for it."""
        entries = dict(body.entries)
        for key in ("then", "failed"):
            goal = body.get(key)
            if key == "then" and isinstance(goal, Scalar) and goal.text == END:
                del entries[key]
            elif isinstance(goal, Scalar):
                entries[key] = entries[key]._replace(value=self._goal(goal))
        ways = body.get("next")
        if isinstance(ways, Sequence):
            items = tuple(self._way(item) for item in ways.items)
            entries["next"] = entries["next"]._replace(value=Sequence(items, ways.span))
        return Mapping(entries, body.span)

    def _way(self, item: Node) -> Node:
        go = item.get("go") if isinstance(item, Mapping) else None
        if not isinstance(item, Mapping) or not isinstance(go, Scalar):
            return item
        entry = item.entries["go"]._replace(value=self._goal(go))
        return Mapping({**item.entries, "go": entry}, item.span)

    def _goal(self, goal: Scalar) -> Scalar:
        if goal.text in self.behaviors:
            return goal._replace(text=f"{self.state}.{goal.text}")
        if goal.text == END:
            if isinstance(self.end, Scalar):
                return goal._replace(text=self.end.text)
            message = f"`{self.state}` does not say what follows `end`"
            hint = "write `then: NAME` where the chain is used"
            self.found.append(Diagnostic("KYB161", message, goal.span, help=hint))
        elif goal.text not in BUILT_IN:
            self.found.append(unknown(goal, self.behaviors))
        return goal


def unknown(name: Scalar, behaviors: Collection[str]) -> Diagnostic:
    """KYB158 for a name that no behavior of the chain has."""
    message = f"the chain has no behavior `{name.text}`"
    hint = did_you_mean(name.text, [*behaviors, END])
    return Diagnostic("KYB158", message, replace(name.span, used=()), help=hint)
