"""Keys without a value: what YAML makes of a decimal comma, of a forgotten colon and of a comma in
a text, and what was probably meant.

YAML ends a plain value at a comma inside of `{...}` and takes what follows for a key, with null for
its value; nulls are the same as not written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from kybflow.core.text import as_typed
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.reading.nodes import NAME, MappingEntry, Scalar, is_cut, no_commas

CODES = {
    "KYB014": "A key without a colon: a decimal comma, a comma in a text or a forgotten colon.",
    "KYB015": "A key with a colon and nothing behind it (a warning).",
}
CONDITIONS = frozenset({"when", "healthy"})
"""The keys whose values are conditions."""
_TEXTS = frozenset({"log", "stop", "summary", "help"})
_COMPARED = re.compile(r"[<>=]|\w in \w")
_JOIN = "the language has no commas: write `and` where both must hold"
_JOINED = re.compile(r"([A-Za-z_]\w*):(\S.*)\Z", re.ASCII | re.DOTALL)
"""What YAML takes for one word: a key and its value without a space between."""
_TWO_WORDS = re.compile(r"([A-Za-z_]\w*)(?:\s*=\s*|\s+)([^\s=<>].*)\Z", re.ASCII | re.DOTALL)
"""A key and its value without a colon."""
_LAST_NUMBER = re.compile(r"(?:^|.*[\s<>=(\[])[-+]?\d+\Z", re.DOTALL)
_DIGITS = re.compile(r"\d+(?!\w*[.:])")
_THOUSANDS = re.compile(r"\d{3}\b")
_IN_PARENTHESES = re.compile(r"\([-+\d.][^()]*\)\Z")
"""A list that another language writes so."""
_SHOWN = 60


def without_colon(before: MappingEntry | None, keys: Sequence[Scalar]) -> Iterator[Diagnostic]:
    """The findings for `keys` that have no colon and follow each other in one mapping, behind the
    entry `before`; None where nothing stands before them."""
    value = before.value if before else None
    name = before.key.text if before else ""
    text = value.text if isinstance(value, Scalar) else ""
    first, hint = keys[0], ""
    row = ", ".join([text, *(key.text for key in keys)])
    if _IN_PARENTHESES.match(row):
        yield _cut(name, text, first, f"write `{name}: [{row[1:-1]}]`")
        return
    if is_cut(Scalar(text, first.span)):
        hint = no_commas(f"{text}, {first.text}")
    elif _LAST_NUMBER.match(text) and _DIGITS.match(first.text):
        hint = _number(name, text, keys)
    if not hint and name in _TEXTS and text:
        hint = "put the text in quotes"
    elif not hint and (name in CONDITIONS or _COMPARED.search(first.text)):
        hint = missing_colon(first.text) if not _COMPARED.search(first.text) else _JOIN
        hint = hint or _JOIN
        name = name if name in CONDITIONS else "when"
    if hint and text:
        yield _cut(name, text, first, hint)
        keys = () if _is_row(text, keys) else keys[1:]
    for key in keys:
        yield _lone(key)


def _number(name: str, text: str, keys: Sequence[Scalar]) -> str:
    """The help for a number that goes on behind a comma."""
    if len(keys) > 1 and _is_row(text, keys):
        return f"write `{name}: [{', '.join([text, *(key.text for key in keys)])}]` for a list"
    point = f"write `{name}: {text}.{keys[0].text}`, with a decimal point"
    if _THOUSANDS.match(keys[0].text):
        return f"{point}, or `{name}: {text}{keys[0].text}` where thousands are meant"
    return point


def _is_row(text: str, keys: Sequence[Scalar]) -> bool:
    """Whether several numbers stand in a row, as a list has them."""
    return len(keys) > 1 and all(_BARE.match(one) for one in (text, *(key.text for key in keys)))


_BARE = re.compile(r"[-+]?\d+(\.\d*)?\Z", re.ASCII)


def _cut(name: str, text: str, key: Scalar, hint: str) -> Diagnostic:
    message = f"YAML ends `{name}` at the comma and reads `{key.text[:_SHOWN]}` as a key"
    return Diagnostic("KYB014", message, key.span, notes=(f"`{name}` is `{text}`",), help=hint)


def _lone(key: Scalar) -> Diagnostic:
    if not key.quoted and (joined := _JOINED.match(key.text)):
        message = f"a space is missing after `{joined[1]}:`"
        return Diagnostic("KYB010", message, key.span, help=f"write `{joined[1]}: {joined[2]}`")
    shown = key.text[:_SHOWN]
    if hint := missing_colon(key.text):
        return Diagnostic("KYB014", f"a colon is missing in `{shown}`", key.span, help=hint)
    hint = f"write `{shown}: VALUE`; a list stands in `[...]`, a text with braces in quotes"
    return Diagnostic("KYB014", f"the key `{shown}` has no value", key.span, help=hint)


def missing_colon(text: str) -> str:
    """The help for a text that is probably a key and its value, like `height 1 m`, `height=1 m`, or
    with the colon of another keyboard; empty where it is none."""
    typed = as_typed(text)
    parts = _JOINED.match(typed) or _TWO_WORDS.match(typed)
    return f"write `{parts[1]}: {parts[2].strip()[:_SHOWN]}`" if parts else ""


def empty(key: Scalar) -> Diagnostic:
    """KYB015: a key with a colon and nothing behind it, which is the same as not written."""
    name = key.text[:_SHOWN]
    hint = "write one, indent what belongs to it, or remove it; `null` removes what `like` brings"
    return Diagnostic(
        "KYB015", f"`{name}` has no value", key.span, help=hint, severity=Severity.WARNING
    )


def doubled_colon(key: Scalar) -> Diagnostic:
    """KYB010 for `then:: hold`, whose first colon YAML takes for a part of the name."""
    name = key.text.rstrip(": ")
    return Diagnostic("KYB010", f"`{name}` has two colons", key.span, help=f"write `{name}: ...`")


def is_doubled(key: Scalar) -> bool:
    return (
        not key.quoted and key.text.endswith(":") and NAME.match(key.text.rstrip(": ")) is not None
    )
