"""Where the mission flies: the chosen target; each vehicle's driver, tracker and sensors on it; the
target's inputs; and the control rate that the drivers need."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from collections.abc import Mapping as MappingOf
from dataclasses import replace
from typing import TYPE_CHECKING

from kybflow.core.errors import KybflowError
from kybflow.core.params import fields_of
from kybflow.core.signals import MeasurementKind
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Collector, Severity, Span, Text
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.records import Source, layout_of
from kybflow.dsl.plan import InputPlan, PartPlan, Place, SensorPlan, TargetKeys, VehiclePlan
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    entries_of,
    is_null,
    items_of,
)

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CODES = {
    "KYB150": "The mission doesn't have this target.",
    "KYB151": "A target names an unknown vehicle, or leaves a vehicle without a driver.",
    "KYB390": "A sensor is assigned to an estimator that the vehicle doesn't have.",
    "KYB400": "A target replaces an input that the mission doesn't have, or a vehicle is called "
    "`inputs`, which is a key of every target.",
    "KYB408": "Two names in `buttons` for one button of the device, or one that is a key of the "
    "input, such as `dead_man`.",
}
_NOT_HERE = frozenset({"KYB140", "KYB141", "KYB370"})
FILE = "--target"
"""The file name in the span of an unknown target."""
_OWN = frozenset(field.key for field in fields_of(TargetKeys))
"""The keys of a target that are not vehicles."""


class Target:
    """The chosen target of a mission: its name, and its entries as written."""

    def __init__(self, root: Mapping, target: str | None, decoder: Decoder) -> None:
        """Decode the target called `target`, which is `sim` if that is None."""
        self._decoder, self._found, catalog = decoder, decoder.found, decoder.catalog
        self._vehicles = entries_of(root.get("vehicles"))
        self._targets = entries_of(root.get("targets"))
        name = target or "sim"
        self.is_written = name in self._targets
        entries = entries_of(self._targets[name].value) if self.is_written else {}
        self._places = self._decoded(entries, decoder)
        self.name = Text(name, root.entries["mission"].key.span, verbatim=False)
        if self.is_written:
            self.name = self._targets[name].key.as_text
        elif self._implied() is None:
            known = {*self._targets, *dict(implied_targets(catalog))}
            message = f"the mission has no target `{name}`"
            place = Span(FILE, 1, 1, 1, len(name) + 1)
            self._found.report("KYB150", message, place, help=did_you_mean(name, known))

    def drivers(self) -> dict[str, PartPlan]:
        """Return the driver of each vehicle: from its own entry, or else from `all`, or else the
        driver that the target's name implies."""
        written = {n: p.driver for n, p in self._places.items() if p.entry("driver") is not None}
        if "all" not in written and not self._vehicles.keys() <= written.keys():
            implied = self._implied()
            node = None if implied is None else _node(implied, self.name.span)
            if node is not None and (part := self._decoder.part("drivers", node)) is not None:
                written["all"] = part
        drivers: dict[str, PartPlan] = {}
        for name in self._vehicles:
            driver = written.get(name, written.get("all"))
            if driver is not None:
                drivers[name] = driver
            elif self.is_written and name not in written and "all" not in written:
                target = self.name.text
                message = f"`{name}` has no driver on the target `{target}`"
                hint = f"write `{target}: {{{name}: {{driver: NAME}}}}`"
                hint += "; `kybflow parts` lists the drivers"
                self._found.report("KYB151", message, self.name.span, help=hint)
        return drivers

    def _implied(self) -> dict[str, str] | None:
        """Return the driver that the target's name implies, with its parameters as text."""
        targets = implied_targets(self._decoder.catalog)
        return next((driver for name, driver in targets if name == self.name.text), None)

    def _decoded(self, entries: MappingOf[str, MappingEntry], decoder: Decoder) -> dict[str, Place]:
        """Return the entries of a target, for `all` and for each vehicle."""
        places: dict[str, Place] = {}
        for name, entry in entries.items():
            if name in _OWN:
                continue
            if name == "all":
                known = [label for e in self._vehicles.values() for label in _estimators(e.value)]
            elif name in self._vehicles:
                known = list(_estimators(self._vehicles[name].value))
            else:
                hint = did_you_mean(name, [*self._vehicles, "all"])
                message = f"no vehicle is called `{name}`"
                decoder.found.report("KYB151", message, entry.key.span, help=hint)
                continue
            place: Place = decoder.record(Place, entry.value, entry.key.span)
            places[name] = place
            for label, _ in place.pairs("sensors"):
                if label.text in place.sensors and label.text not in known:
                    lacks = "no vehicle has an" if name == "all" else f"`{name}` has no"
                    message = f"{lacks} estimator `{label.text}`"
                    hint = did_you_mean(label.text, known)
                    hint = hint or "name one under `estimators` of the vehicle"
                    decoder.found.report("KYB390", message, label.span, help=hint)
        return places

    def judge_others(self) -> None:
        """Report errors in the other targets. A part that is not installed and a missing file are
        only warnings there."""
        for name, entry in self._targets.items():
            if name == self.name.text:
                continue
            found, entries = Collector(), entries_of(entry.value)
            decoder = Decoder(self._decoder.catalog, found)
            self._decoded(entries, decoder)
            for own in inputs_in(entry.value).values():
                if not is_null(own.value):
                    decoder.record(InputPlan, own.value, own.key.span, name="", button_names={})
            self._found.add(
                replace(d, severity=Severity.WARNING) if d.code in _NOT_HERE else d
                for d in found.all
            )

    def equipped(self, vehicles: Iterable[VehiclePlan]) -> Iterator[VehiclePlan]:
        """Yield the vehicles with their sensors and trackers.

        The sensors of an estimator are from the vehicle's own entry, or else from `all`; the
        driver's additional sensors follow. The tracker is from the vehicle's own entry, or else
        from `all`, or else the one that the driver requests, or else the mission's.
        """
        shared = self._places.get("all", Place())
        for vehicle in vehicles:
            own = self._places.get(vehicle.name, Place())
            labels = set(_estimators(self._vehicles[vehicle.name].value))
            named = {k: v for k, v in _sensors(shared).items() if k in labels}
            lists = {**named, **_sensors(own)}.values()
            sensors = [use for several in lists for use in several]
            sensors += self._brought(vehicle, sensors)
            tracker, driver = own.tracker or shared.tracker, vehicle.driver
            if tracker is None and (requested := driver.cls.tracker(driver.params)) is not None:
                tracker = self._decoder.part("trackers", _node(requested, driver.span))
            yield vehicle.but(
                sensors=tuple(sensors),
                tracker=tracker or vehicle.tracker,
                own_tracker=None if tracker is None else vehicle.tracker,
                reached=own.but(
                    **{
                        field.name: getattr(shared, field.name)
                        for field in fields_of(Place)
                        if not own.is_written(field.key)
                    }
                ),
            )

    def _brought(self, vehicle: VehiclePlan, own: list[SensorPlan]) -> list[SensorPlan]:
        """Return the sensors that the driver adds for estimators that lack measurements. Their
        source location is the first such estimator."""
        given, driver = provided(vehicle.but(sensors=tuple(own))), vehicle.driver
        shows = driver.cls.shows(driver.params)
        parts = [use.part for use in vehicle.estimators]
        lacking = [(p, kinds) for p in parts if (kinds := p.cls.uses(p.params) - given)]
        brought: list[SensorPlan] = []
        for name in driver.cls.brings if lacking else ():
            part = self._decoder.part("sensors", Scalar(name, lacking[0][0].span))
            if part is None or part.cls.simulated > shows:
                continue
            if part.cls.provides & {k for _, kinds in lacking for k in kinds}:
                lacking = [(p, kinds - part.cls.provides) for p, kinds in lacking]
                brought.append(SensorPlan(part))
        return brought


def implied_targets(catalog: Catalog) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the targets that every mission has, each with its driver and the driver's parameters as
    text. After `sim`, imports one driver after the other."""
    yield "sim", {"use": "sim"}
    for name in catalog.names("drivers"):
        try:
            targets = catalog.get("drivers", name).cls.targets
        except (KybflowError, ImportError):  # reported when the driver is used
            continue
        for target, values in targets.items():
            written = {k: str(v).lower() if isinstance(v, bool) else v for k, v in values.items()}
            yield target, {"use": name, **written}


def _node(values: dict[str, str], span: Span) -> Mapping:
    """Return a mapping of texts as if an author had written it at `span`."""
    entries = {k: MappingEntry(Scalar(k, span), Scalar(value, span)) for k, value in values.items()}
    return Mapping(entries, span)


def _sensors(place: Place) -> dict[str, list[SensorPlan]]:
    """Return the sensors in an entry of a target, by estimator."""
    return {
        label.text: [
            SensorPlan(part, (label.text,), index, source=Source(label.span))
            for index, part in enumerate(place.sensors.get(label.text, ()))
            if part is not None
        ]
        for label, _ in place.pairs("sensors")
    }


def _estimators(vehicle: Node) -> Iterator[str]:
    """Yield the names of a vehicle's estimators, whether or not they can be decoded."""
    for item in items_of(vehicle.get("estimators") if isinstance(vehicle, Mapping) else None):
        name: Node | None = item
        if isinstance(item, Mapping):
            name = item.get("as") or item.get("use")
        if isinstance(name, Scalar):
            yield name.text


def provided(vehicle: VehiclePlan) -> frozenset[MeasurementKind]:
    """Return the kinds of measurement that the vehicle's driver and sensors provide."""
    sources = (vehicle.driver, *(use.part for use in vehicle.sensors))
    return frozenset(kind for part in sources for kind in part.cls.provides)


CONTROL_RATE = 125
"""The usual control rate, Hz."""


def needed_rate(drivers: Iterable[PartPlan]) -> int:
    """Return the lowest control rate (Hz) that all drivers accept. If its ticks don't fall on the
    simulation steps of each driver but those of the usual rate do, return the usual rate. KYB303
    reports the case that neither does."""
    used = [(use.cls, use.params) for use in drivers]
    needed = max((driver.control_rate(params) for driver, params in used), default=CONTROL_RATE)
    steps = [rate for driver, params in used if (rate := driver.step_rate(params)) is not None]
    fitting = (r for r in (needed, CONTROL_RATE) if all(divides(r, step) for step in steps))
    return next(fitting, needed)


def divides(control: int, steps: float) -> bool:
    """Return whether every tick falls on a step. control: ticks per second. steps: steps per
    second."""
    each = round(steps / control)
    return each >= 1 and abs(steps / control - each) < 1e-9


def inputs_in(target: Node | None) -> MappingOf[str, MappingEntry]:
    """Return the inputs of a target that replace the mission's, as written."""
    written = entries_of(target)
    return entries_of(written["inputs"].value) if "inputs" in written else {}


def inputs_of(root: Mapping, target: str, decoder: Decoder) -> tuple[InputPlan, ...]:
    """Return the inputs on a target, without those that have errors."""
    own, targets = entries_of(root.get("inputs")), entries_of(root.get("targets"))
    vehicle = entries_of(root.get("vehicles")).get("inputs")
    for entry in targets.values():
        for name, other in inputs_in(entry.value).items():
            if name not in own:
                hint = did_you_mean(name, own) or f"write `inputs: {{{name}: {{use: ...}}}}` in it"
                message = f"the mission has no input `{name}`"
                decoder.found.report("KYB400", message, other.key.span, "unknown", help=hint)
        if vehicle is not None:
            message, hint = "a vehicle can't be called `inputs`", "give it another name"
            decoder.found.report("KYB400", message, vehicle.key.span, help=hint)
    replaced = inputs_in(targets[target].value) if target in targets else {}
    inputs: list[InputPlan] = []
    for name, entry in own.items():
        written = (e.value for e in (entry, replaced.get(name)) if e is not None)
        made = [_input(entry.key, value, decoder) for value in written if not is_null(value)]
        if made and made[-1] is not None:  # one that is replaced is checked, too
            inputs.append(made[-1])
    return tuple(inputs)


def _input(own: Scalar, node: Node, decoder: Decoder) -> InputPlan | None:
    one: InputPlan | None = decoder.record(
        InputPlan, node, own.span, name=own.text, button_names={}
    )
    if one is None:
        return None
    cls, params = one.part.cls, one.part.params
    stuck = cls.stuck_after if one.stuck_after is None else one.stuck_after
    given: dict[str, str] = {}
    buttons = one.entry("buttons")
    for name, entry in entries_of(None if buttons is None else buttons.value).items():
        device = one.buttons[name]
        if name in layout_of(InputPlan).keys:
            message = f"a button can't be called `{name}`, which is a key of an input"
            hint = f"write `{name}: ...` beside `buttons` if that is meant, or another name"
            decoder.found.report("KYB408", message, entry.key.span, help=hint)
        if device in given:
            message = f"the button `{device}` can't be both `{given[device]}` and `{name}`"
            decoder.found.report(
                "KYB408",
                message,
                entry.value.span,
                help=f"give `{name}` another button, or remove it",
            )
        given.setdefault(device, name)
    names = {b: given.get(b, b) for b in cls.buttons(params) if b in given or b not in one.buttons}
    return one.but(stuck_after=stuck, button_names=names, at=one.part.span.at)
