"""Parameters whose bounds leave nothing, whose default breaks them or the mission, or that nothing
uses."""

from __future__ import annotations

from harms.mission_text import Mission, Node, add, everywhere, own_section, put
from harms.operator import Changes, change, dangerous, senseless


def _declared(mission: Mission) -> list[tuple[str, Node, Node]]:
    """Name, key and declaration."""
    return [(key.value, key, node) for key, node in mission.pairs("parameters")]


def _uses(mission: Mission, name: str) -> list[Node]:
    return [v for _, v in everywhere(mission.root) if v.id == "scalar" and v.value == f"${name}"]


@senseless
def default_beyond_its_bounds(mission: Mission) -> Changes:
    """The default is ten times its own `at_most`."""
    for _, _, node in _declared(mission):
        default, most = (mission.at(k, of=node) for k in ("default", "at_most"))
        limit = mission.quantity(most)
        if default is not None and limit is not None:
            yield change(put(default, f"{10 * limit.number:g} {limit.unit}"), also=(most,))


@senseless
def bounds_swapped(mission: Mission) -> Changes:
    """`at_least` over `at_most`: no value is left."""
    for _, _, node in _declared(mission):
        low, high = (mission.at(k, of=node) for k in ("at_least", "at_most"))
        if low is not None and high is not None and low.value != high.value:
            yield change(put(low, high.value), put(high, low.value))


@senseless
def parameter_that_nothing_uses(mission: Mission) -> Changes:
    """Its uses were replaced by numbers: setting it does nothing."""
    for name, key, node in _declared(mission):
        default, uses = mission.at("default", of=node), _uses(mission, name)
        elsewhere = mission.text.count(f"${name}") - len(uses)
        if default is not None and uses and not elsewhere:
            text = mission.text[default.start_mark.index : default.end_mark.index]
            yield change(*(put(use, text) for use in uses), also=(key,))


@senseless
def parameter_left_over(mission: Mission) -> Changes:
    """A parameter from another mission that nothing uses."""
    yield change(own_section(mission, "parameters", "lap_time: {type: duration, default: 9 s}"))


@senseless
def parameter_of_another_type(mission: Mission) -> Changes:
    """A length is declared as a duration."""
    for _, _, node in _declared(mission):
        kind = mission.at("type", of=node)
        if kind is not None:
            yield change(put(kind, "duration" if kind.value != "duration" else "length"))


@senseless
def parameter_misspelled(mission: Mission) -> Changes:
    """`$heigth`: no parameter has that name."""
    for name, _, _ in _declared(mission):
        for use in _uses(mission, name):
            yield change(put(use, f"${name[:-1]}"))


@dangerous
def default_above_the_ceiling(mission: Mission) -> Changes:
    """A default that flies above the ceiling; its bound was lifted with it."""
    for name, _, node in _declared(mission):
        default, most = (mission.at(k, of=node) for k in ("default", "at_most"))
        if default is not None and name == "height":
            edits = [put(default, "4 m"), *([put(most, "5 m")] if most is not None else [])]
            yield change(*edits)


@dangerous
def default_place_outside(mission: Mission) -> Changes:
    """A place that is a parameter has a default outside of the fence."""
    for _, _, node in _declared(mission):
        default = mission.at("default", of=node)
        if default is not None and mission.word("type", of=node) == "position":
            yield change(put(default, "[9, 0, 1]"))


@dangerous
def default_lap_too_short(mission: Mission) -> Changes:
    """A lap of 1 s by default, with its bound lifted: sharper than anything tilts."""
    for name, _, node in _declared(mission):
        default, least = (mission.at(k, of=node) for k in ("default", "at_least"))
        if default is not None and least is not None and name == "lap":
            yield change(put(default, "1 s"), put(least, "500 ms"))


@dangerous
def default_parcel_too_heavy(mission: Mission) -> Changes:
    """A parcel of 46 kg for 46 g, its bound lifted with it."""
    for _, _, node in _declared(mission):
        default, most = (mission.at(k, of=node) for k in ("default", "at_most"))
        if default is not None and most is not None and mission.word("type", of=node) == "mass":
            yield change(put(default, "46 kg"), put(most, "60 kg"))


@dangerous
def default_speed_too_high(mission: Mission) -> Changes:
    """A speed of 60 m/s by default, its bound lifted with it."""
    for _, _, node in _declared(mission):
        default, most = (mission.at(k, of=node) for k in ("default", "at_most"))
        is_speed = mission.word("type", of=node) == "speed"
        if default is not None and most is not None and is_speed:
            yield change(put(default, "60 m/s"), put(most, "80 m/s"))


@senseless
def parameter_without_a_value(mission: Mission) -> Changes:
    """The default is empty: the mission can't be flown as it is."""
    for _, _, node in _declared(mission):
        default = mission.at("default", of=node)
        if default is not None:
            yield change(put(default, ""))


@senseless
def bound_of_another_dimension(mission: Mission) -> Changes:
    """`at_most: 3 kg` of a length."""
    for _, _, node in _declared(mission):
        if mission.word("type", of=node) in ("length", "duration", "speed"):
            most = mission.at("at_most", of=node)
            yield change(put(most, "3 kg") if most is not None else add(node, "at_most: 3 kg"))
