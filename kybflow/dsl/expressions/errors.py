"""What can be wrong with an expression, one function a code. Places are characters of the text."""

from __future__ import annotations

import re
from collections.abc import Collection

from kybflow.core.text import as_typed, did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.diagnostics.spans import PREFIX, Text
from kybflow.dsl.expressions.tokens import Token
from kybflow.dsl.reading.nodes import NAME_A_POINT, no_commas

_HABITS = {
    "=": "write `==`",
    "!": "write `not` or `!=`",
    "&": "write `and`",
    "|": "write `or`",
    "$": "a parameter is written as a word of its own",
    "°": "write `deg`",
}
_MOST = 6
"""Names in a help line."""
_COORDINATES = re.compile(r"[([]?[-+\d.]+[\s,]+[-+\d.]+[\s,]+[-+\d.]+[)\]]?\s*\)")
"""A point written out as the last argument of a function."""


class Unreadable(Exception):
    """Raised inside the parser where it can't go on; carries the finding."""

    def __init__(self, finding: Diagnostic) -> None:
        super().__init__(finding.message)
        self.finding = finding


def unreadable(text: Text, token: Token, expected: str) -> Unreadable:
    """KYB210: the text is no expression of the language."""
    found = f"`{token.text}`" if token.text else "the end"
    return Unreadable(
        Diagnostic(
            "KYB210",
            f"found {found} where {expected} should be",
            text.part(token.start, token.end),
            label=f"expected {expected}",
            help=_way_out(text.text, token),
        )
    )


def misspelt(text: Text, token: Token, near: str) -> Unreadable:
    """KYB210: the text is no expression of the language."""
    message, span = f"no expectation begins with `{token.text}`", text.part(token.start, token.end)
    return Unreadable(
        Diagnostic("KYB210", message, span, label="unknown", help=f"did you mean `{near}`?")
    )


def _way_out(text: str, token: Token) -> str:
    before, after = text[: token.start], text[token.end :]
    if token.text == "," and before[-1:].isdigit() and after[:1].isdigit():
        number, rest = re.split(r"[^\d]", before)[-1], re.split(r"[^\d]", after)[0]
        return f"write `{number}.{rest}`, with a decimal point"
    if not token.text.isascii() and (typed := as_typed(token.text)) != token.text:
        return f"write `{typed}`, as a keyboard has it"
    if before.count("[") > before.count("]") or _COORDINATES.match(text, token.start):
        return NAME_A_POINT
    if token.text == "," and before.count("(") <= before.count(")"):
        return "the language has no comma: write `and` where both must hold"
    if token.text == ",":
        return no_commas(text[max(0, before.rfind("(") - len("separation")) :])
    if not token.text and text.count("(") > text.count(")"):
        return "inside {...} YAML ends a value at a comma: write `distance(a to b)` without one"
    return _HABITS.get(token.text, "")


def too_deep(text: Text, token: Token, limit: int) -> Unreadable:
    """KYB214: an expression is nested too deep or is too long."""
    span = text.part(token.start, token.end)
    message = f"an expression may be nested {limit} deep, this one is deeper"
    return Unreadable(Diagnostic("KYB214", message, span, label="too deep"))


def too_long(text: Text, limit: int) -> Unreadable:
    """KYB214: an expression is nested too deep or is too long."""
    message = f"an expression may have {limit} characters, this one has {len(text.text)}"
    return Unreadable(Diagnostic("KYB214", message, text.span, label="too long"))


def unknown(
    text: Text, place: tuple[int, int], message: str, name: str, known: Collection[str]
) -> Diagnostic:
    """KYB211: a name that nothing in the mission has."""
    span = text.part(*place)
    members = [f"`{one}`" for one in known if one.startswith(f"{name}.") or one == PREFIX + name]
    if len(members) > 1:
        hint = f"write one of {', '.join(members[:_MOST])}"
    else:
        hint = f"did you mean {members[0]}?" if members else did_you_mean(name, known)
    return Diagnostic("KYB211", message, span, label="unknown", help=hint)


def no_payload(text: Text, place: tuple[int, int], vehicle: str) -> Diagnostic:
    """KYB211: a name that nothing in the mission has."""
    way_out = f"give `{vehicle}` one: `payload: {{mass: 200 g, size: 10 cm}}`"
    message, span = f"`{vehicle}` carries no payload", text.part(*place)
    return Diagnostic("KYB211", message, span, label="unknown", help=way_out)


def known_to_the_simulator(text: Text, place: tuple[int, int], name: str) -> Diagnostic:
    """KYB213: a form that belongs elsewhere."""
    message = f"where `{name}` is, only a simulator knows; no condition is asked of it"
    way_out = "ask for it in `expect:`; a condition may ask `payload == released`"
    return Diagnostic("KYB213", message, text.part(*place), label="not here", help=way_out)


def group_for_one(text: Text, token: Token, message: str) -> Diagnostic:
    """KYB212: two sides that can't be compared, or a quantity of another dimension or without its
    unit, or a group where one vehicle is needed."""
    way_out = f"write `all {token.text} in STATE` or `any {token.text} in STATE`"
    span = text.part(token.start, token.end)
    return Diagnostic("KYB212", message, span, label="several vehicles", help=way_out)


def mismatch(
    text: Text, place: tuple[int, int], message: str, label: str, way_out: str
) -> Diagnostic:
    """KYB212: two sides that can't be compared, or a quantity of another dimension or without its
    unit."""
    return Diagnostic("KYB212", message, text.part(*place), label=label, help=way_out)


def never_reached(text: Text, place: tuple[int, int], other: str) -> Diagnostic:
    """KYB215: a bound that can't be reached: a share is from 0 % to 100 %, a time after the
    start."""
    message = f"`{other}` is never more than 100 % or less than 0 %"
    return Diagnostic("KYB215", message, text.part(*place), label="never reached")


def before_the_start(text: Text, place: tuple[int, int]) -> Diagnostic:
    """KYB215: a bound that can't be reached: a share is from 0 % to 100 %, a time after the
    start."""
    message = "nothing can happen before the run begins"
    way_out = "write a time above 0 s, which counts from the start"
    return Diagnostic("KYB215", message, text.part(*place), label="no time left", help=way_out)


def misplaced_statistic(text: Text, place: tuple[int, int], function: str) -> Diagnostic:
    """KYB213: a form that belongs elsewhere."""
    message = f"`{function}(...)` looks at a whole run; a condition is asked every tick"
    way_out = "a statistic stands in `expect:`, compared with a quantity"
    return Diagnostic("KYB213", message, text.part(*place), label="not here", help=way_out)


def joined_statistics(text: Text, place: tuple[int, int]) -> Diagnostic:
    """KYB213: a form that belongs elsewhere."""
    message = "statistics can't be joined with `and`, `or` or `not`"
    way_out = "write each comparison as a line of its own"
    return Diagnostic("KYB213", message, text.part(*place), label="joined here", help=way_out)


def momentary(text: Text, place: tuple[int, int]) -> Diagnostic:
    """KYB213: a form that belongs elsewhere."""
    message = "a statistic is compared with a quantity or with another statistic"
    way_out = "write `max(...)` or another statistic around the other side"
    return Diagnostic("KYB213", message, text.part(*place), label="of which time?", help=way_out)


def timeless(text: Text, place: tuple[int, int]) -> Diagnostic:
    """KYB213: a form that belongs elsewhere."""
    message = "this expectation does not say when it should hold"
    way_out = "write `always`, `eventually` or `finally` before it, or `max(...)` around a value"
    return Diagnostic("KYB213", message, text.part(*place), label="when?", help=way_out)
