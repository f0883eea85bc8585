"""Keys without a value: what YAML makes of a decimal comma, of a forgotten colon and of a comma in
a text, and what was probably meant.

YAML ends a plain value at a comma inside of `{...}` and takes what follows for a key, with null for
its value; nulls are the same as not written.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from kybflow.core.text import as_typed
from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.reading.nodes import MappingEntry, Scalar, is_cut, no_commas

CODES = {
    "KYB014": "A key without a colon: a decimal comma, a comma in a text or a forgotten colon.",
}
CONDITIONS = frozenset({"when", "healthy"})
"""The keys whose values are conditions."""
_TEXTS = frozenset({"log", "stop", "summary", "help"})
_COMPARED = re.compile(r"[<>=]|\w in \w")
_JOINED = re.compile(r"([A-Za-z_]\w*):(\S.*)\Z", re.ASCII | re.DOTALL)
"""What YAML takes for one word: a key and its value without a space between."""
_TWO_WORDS = re.compile(r"([A-Za-z_]\w*)(?:\s*=\s*|\s+)([^\s=<>].*)\Z", re.ASCII | re.DOTALL)
"""A key and its value without a colon."""
_LAST_NUMBER = re.compile(r"(?:^|.*[\s<>=(\[])[-+]?\d+\Z", re.DOTALL)
_DIGITS = re.compile(r"\d+(?!\w*[.:])")
_BARE = re.compile(r"[-+]?\d+(\.\d*)?\Z", re.ASCII)
_THOUSANDS = re.compile(r"\d{3}\b")
_IN_PARENTHESES = re.compile(r"\([-+\d.][^()]*\)\Z")
"""A list that another language writes so."""
_SHOWN = 60


def without_colon(before: MappingEntry | None, keys: Sequence[Scalar], found: Findings) -> None:
    """Report `keys` that have no colon and follow each other in one mapping, behind the entry
    `before`; None where nothing stands before them."""
    name, value = (before.key.text, before.value) if before else ("", None)
    text, first = value.text if isinstance(value, Scalar) else "", keys[0].text
    row = [text, *(key.text for key in keys)]
    listed = ", ".join(row)
    is_list = _IN_PARENTHESES.match(listed) is not None
    is_row = len(keys) > 1 and all(map(_BARE.match, row))
    hint = ""
    if is_list:
        hint = f"write `{name}: [{listed[1:-1]}]`"
    elif value is not None and is_cut(value):
        hint = no_commas(f"{text}, {first}")
    elif _LAST_NUMBER.match(text) and _DIGITS.match(first):
        hint = f"write `{name}: {text}.{first}`, with a decimal point"
        if is_row:
            hint = f"write `{name}: [{listed}]` for a list"
        elif _THOUSANDS.match(first):
            hint = f"{hint}, or `{name}: {text}{first}` where thousands are meant"
    elif name in _TEXTS and text:
        hint = "put the text in quotes"
    elif name in CONDITIONS or _COMPARED.search(first):
        hint = "" if _COMPARED.search(first) else missing_colon(first)
        hint = hint or "the language has no commas: write `and` where both must hold"
        name = name if name in CONDITIONS else "when"
    if hint and text:
        message = f"YAML ends `{name}` at the comma and reads `{first[:_SHOWN]}` as a key"
        notes = (f"`{name}` is `{text}`",)
        found.report("KYB014", message, keys[0].span, notes=notes, help=hint)
        keys = () if is_list or is_row else keys[1:]
    for key in keys:
        _without_value(key, found)


def _without_value(key: Scalar, found: Findings) -> None:
    shown = key.text[:_SHOWN]
    if not key.quoted and (joined := _JOINED.match(key.text)):
        message = f"a space is missing after `{joined[1]}:`"
        found.report("KYB010", message, key.span, help=f"write `{joined[1]}: {joined[2]}`")
    elif hint := missing_colon(key.text):
        found.report("KYB014", f"a colon is missing in `{shown}`", key.span, help=hint)
    else:
        hint = f"write `{shown}: VALUE`; a list stands in `[...]`, a text with braces in quotes"
        found.report("KYB014", f"the key `{shown}` has no value", key.span, help=hint)


def missing_colon(text: str) -> str:
    """The help for a text that is probably a key and its value, like `height 1 m`, `height=1 m`, or
    with the colon of another keyboard; empty where it is none."""
    typed = as_typed(text)
    parts = _JOINED.match(typed) or _TWO_WORDS.match(typed)
    return f"write `{parts[1]}: {parts[2].strip()[:_SHOWN]}`" if parts else ""
