"""Safety parameters only tighten while their vehicle flies."""

from __future__ import annotations

from typing import Any

from kybflow.core.params import Field


def loosened(name: str, field: Field, before: Any, after: Any) -> str | None:
    """Why `after` can't follow `before` in flight, None when it can. A number tightens in the
    direction of its declaration, of a vector each one; a choice along its list, but nobody makes
    `cut` of it in flight: that is no way down."""
    if field.tightens is None or before == after:
        return None
    if after == "cut":
        return f"`{name}` can't become `cut` in flight"
    old, new = _numbers(field, before), _numbers(field, after)
    if field.tightens == "down":
        old, new = new, old
    if len(old) == len(new) and all(b >= a for a, b in zip(old, new, strict=True)):
        return None
    word = "stricter" if field.choices else "greater" if field.tightens == "up" else "smaller"
    return f"`{name}` is a safety parameter: in flight it only becomes {word}"


def _numbers(field: Field, value: Any) -> tuple[float, ...]:
    if value is None:
        return ()
    if field.choices:
        return (float(field.choices.index(value)),)
    return tuple(value) if isinstance(value, tuple) else (float(value),)
