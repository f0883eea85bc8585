"""Expand one vehicle: its airframe with cameras, its parts, and the states of its `behaviors`.

States called `NAME.INNER` belong to the chain `NAME`; an entry `NAME` without `do` holds the
transitions of the whole chain. Each state of the chain has these transitions as well, after its
own, except that a chain's `next` comes first. Their times count from the entry of the chain.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import degrees, tan

from kybflow.core.geometry import Quat, conjugate, from_axes, from_euler, multiply, to_euler
from kybflow.core.text import did_you_mean
from kybflow.dsl.calibration_file import read_calibration
from kybflow.dsl.diagnostics import Collector, Span
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.records import Source
from kybflow.dsl.names import failure_of
from kybflow.dsl.plan import (
    Body,
    Cause,
    ChainPlan,
    PartPlan,
    Start,
    StatePlan,
    TransitionPlan,
    VehiclePlan,
    Ways,
)
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar, entries_of, is_null
from kybflow.dsl.resolving.chains import OF_CHAINS
from kybflow.dsl.world import CameraPlan
from kybflow.parts.observables import chains_of
from kybflow.world.cameras import DOWN, Camera, Lens

CODES = {
    "KYB385": "A camera's lens is not described, or is described twice in one place. It needs "
    "`calibration`, or `width`, `height` and `field_of_view`, which override an inherited lens.",
    "KYB143": "A transition has no condition, or has a `for` without a `when`.",
}
_LENS = ("width", "height", "field_of_view")
_DOWNWARD_AXIS = (0.0, 0.0, -1.0)
FACING: dict[str, Quat] = {
    "down": DOWN,
    "up": from_axes((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "forward": from_axes((0.0, -1.0, 0.0), _DOWNWARD_AXIS, (1.0, 0.0, 0.0)),
    "backward": from_axes((0.0, 1.0, 0.0), _DOWNWARD_AXIS, (-1.0, 0.0, 0.0)),
    "left": from_axes((1.0, 0.0, 0.0), _DOWNWARD_AXIS, (0.0, 1.0, 0.0)),
    "right": from_axes((-1.0, 0.0, 0.0), _DOWNWARD_AXIS, (0.0, -1.0, 0.0)),
}
"""The rotations from the optical frame to the body frame. The image's upper edge points forward for
`down` and `up`, and up for the others."""


def vehicle_of(
    entry: MappingEntry, driver: PartPlan | None, decoder: Decoder
) -> VehiclePlan | None:
    """Return the vehicle, or None if it has errors."""
    name, body, found = entry.key, entry.value, decoder.found
    assert isinstance(body, Mapping)
    airframe, behaviors = body.entries.get("airframe"), entries_of(body.get("behaviors"))
    has_no_airframe = isinstance(body.get("airframe"), Scalar | None)
    lacking = (
        ("airframe", "name one: `airframe: std.mk_quadro`", has_no_airframe),
        ("tracker", "name one: `tracker: cascade`", body.get("tracker") is None),
        ("behaviors", "a vehicle does one thing at least", not behaviors),
    )
    for key, hint, is_lacking in lacking:
        if is_lacking:
            message = f"the vehicle `{name.text}` needs `{key}`"
            found.report("KYB102", message, name.span, help=hint)
    is_whole = driver is not None and not any(is_lacking for *_, is_lacking in lacking)
    for other in (airframe, body.entries.get("begin")):
        if other is not None and decoder.misplaced(other.value, other.key.text):
            is_whole = False
    if behaviors and body.entries["behaviors"].inherited:
        behaviors = {k: e._replace(inherited=True) for k, e in behaviors.items()}
    written = states_of(behaviors, decoder)
    states = {name: one for name, one in written.items() if isinstance(one, StatePlan)}
    chains = {name: one for name, one in written.items() if isinstance(one, ChainPlan)}
    begin = body.get("begin")
    named = begin.text if isinstance(begin, Scalar) else next(iter(states), "")
    inside = (state for state in states if named in chains_of(state))
    first = named if named in states else next(inside, named)
    whole = None
    if airframe is not None and isinstance(airframe.value, Mapping):
        whole = body_of(name.text, airframe.key.span, airframe.value, decoder)
    values = decoder.values(
        VehiclePlan, body, name.span, name=name.text, body=whole, airframe=whole and whole.airframe,
        begin=first, behaviors=written, states=states, chains=chains, driver=driver,
    )  # fmt: skip
    if values is None or not is_whole or whole is None or not first:
        return None
    place = values.setdefault("place", Start())
    own = values.get("supervisors", ())
    has = {use.name for use in own}
    for spec in decoder.catalog.always("supervisors"):
        node = Scalar(spec.name, name.span)
        part = None if spec.name in has else decoder.part("supervisors", node)
        own = own if part is None else (*own, part)
    values["supervisors"] = own
    return VehiclePlan(**values, start=place.at, heading=place.heading)


def states_of(
    behaviors: dict[str, MappingEntry], decoder: Decoder
) -> dict[str, StatePlan | ChainPlan]:
    """Return the states and chains in the entries of `behaviors`, without the states that have
    errors."""
    entries = {name: e for name, e in behaviors.items() if not is_null(e.value)}
    names = [n for n, e in entries.items() if "do" in entries_of(e.value)]
    first: dict[str, str] = {}
    for name in names:
        for chain in chains_of(name):
            first.setdefault(chain, name)
    first = {chain: name for chain, name in first.items() if chain not in names}
    chains = {n: _chain(e, first, decoder) for n, e in entries.items() if n in first}
    found = {n: chains.get(n) or _state(e, first, chains, decoder) for n, e in entries.items()}
    return {name: one for name, one in found.items() if one is not None}


def _chain(entry: MappingEntry, first: dict[str, str], decoder: Decoder) -> ChainPlan:
    name, body = entry.key.text, entry.value
    assert isinstance(body, Mapping)
    for key, inner in body.entries.items():
        if key not in OF_CHAINS:
            message = f"`{key}` is not a key of a chain's own entry"
            hint = did_you_mean(key, OF_CHAINS)
            decoder.found.report("KYB101", message, inner.key.span, help=hint)
    chain: ChainPlan = decoder.record(ChainPlan, body, entry.key.span, entry.inherited, name=name)
    own = _written(chain, first, decoder.found)
    return chain.but(transitions=tuple(way.but(since=name) for way in own))


def _state(
    entry: MappingEntry, first: dict[str, str], chains: dict[str, ChainPlan], decoder: Decoder
) -> StatePlan | None:
    name = entry.key.text
    values = decoder.values(
        StatePlan, entry.value, entry.key.span, entry.inherited, name=name, legs=(), transitions=()
    )
    if values is None:
        return None
    part: PartPlan = values["behavior"]
    behavior = part.but(label=f"behaviors.{name}")
    state = StatePlan(**{**values, "behavior": behavior, "legs": part.cls.flight})
    around = [chains[c].transitions for c in chains_of(name) if c in chains]
    ways = _joined(_written(state, first, decoder.found), around, failure_of(state.legs))
    return state.but(transitions=ways)


def _written(
    entry: StatePlan | ChainPlan, first: dict[str, str], found: Collector
) -> list[TransitionPlan]:
    """Return the transitions of one entry. The target of `within` remains empty here. A chain as a
    target is replaced by its first state."""
    ways = [next_transition(way, found) for way in entry.next]
    causes: tuple[tuple[Cause, str | None], ...] = (("then", entry.then), ("failed", entry.failed))
    for cause, target in causes:
        if target is not None:
            ways.append(_following(entry, cause, target))
    if entry.within is not None:
        ways.append(_following(entry, "within", "", entry.within))
    return [
        way.but(target=first[way.target], enters=way.target) if way.target in first else way
        for way in ways
    ]


def _following(
    entry: StatePlan | ChainPlan, cause: Cause, target: str, after: float | None = None
) -> TransitionPlan:
    span = entry.span_of(cause)
    body = {} if cause == "within" else {"go": entry.source.node.entries[cause]}
    source = Source(span, Mapping(body, span))
    return TransitionPlan(cause=cause, target=target, after=after, at=span.at, source=source)


def _joined(own: list[TransitionPlan], around: list[Ways], implied: str) -> Ways:
    """Return the transitions of a state with those of the chains around it: every `next`, from the
    outermost chain to the state itself; `then` and `failed` of the state, or else of the nearest
    chain; every `within`, the state's own first. implied: the target of `within` if nothing has
    `failed`."""
    inward: list[Iterable[TransitionPlan]] = [own, *reversed(around)]
    transitions = [way for level in (*around, own) for way in level if way.cause == "next"]
    for cause in ("then", "failed"):
        nearest = _first_of(cause, inward)
        if nearest is not None:
            transitions.append(nearest)
    for depth, level in enumerate(inward):
        failed = _first_of("failed", inward[depth:])
        for way in level:
            if way.cause != "within":
                continue
            if failed is None:
                transitions.append(way.but(target=implied))
            else:
                place = way.source._replace(node=failed.source.node)
                target = {"target": failed.target, "enters": failed.enters, "source": place}
                transitions.append(way.but(**target))
    return tuple(transitions)


def _first_of(cause: str, levels: Iterable[Iterable[TransitionPlan]]) -> TransitionPlan | None:
    return next((way for level in levels for way in level if way.cause == cause), None)


def next_transition(way: TransitionPlan, found: Collector) -> TransitionPlan:
    """Return the transition of an item of `next` after checking that it has a condition
    (KYB143)."""
    if all(way.entry(key) is None for key in ("when", "event", "after")):
        message = f"the transition to `{way.target}` has no condition"
        hint = "add `when: CONDITION`, `event: NAME` or `after: 10 s`"
        found.report("KYB143", message, way.span_of("go"), help=hint)
    elif way.entry("when") is None and way.entry("for") is not None:
        message = f"`for` of the transition to `{way.target}` needs a `when`"
        found.report("KYB143", message, way.key_span("for"), help="`for` belongs to a `when`")
    return way


def body_of(name: str, head: Span, node: Mapping, decoder: Decoder) -> Body | None:
    """Return an airframe with its cameras, without the cameras that have errors; None if the
    airframe itself has errors."""
    cameras: list[CameraPlan] = []
    for key, entry in entries_of(node.get("cameras")).items():
        if not isinstance(entry.value, Mapping):
            continue
        written = _with_nearest_lens(entry.value)
        use: CameraPlan | None = decoder.record(CameraPlan, written, entry.key.span, name=key)
        lens = None if use is None else _lens(use, decoder.found)
        if use is not None and lens is not None:
            attitude = multiply(from_euler(use.roll, use.pitch, use.yaw), FACING[use.facing])
            made = Camera(key, lens, use.at, attitude, use.rate, use.row_time)
            cameras.append(use.but(camera=made))
    body: Body = decoder.record(Body, node, head, name=name, cameras=tuple(cameras))
    return body if body.airframe else None


def _with_nearest_lens(body: Mapping) -> Mapping:
    """Return the camera's mapping with only one description of the lens: of a calibration and a
    written lens, the one from fewer `like` steps away."""
    lens = [body.entries[key] for key in _LENS if body.get(key) is not None]
    if not lens or body.get("calibration") is None:
        return body
    own, other = body.entries["calibration"].depth, min(entry.depth for entry in lens)
    passed = _LENS if own < other else ("calibration",) if own > other else ()
    return Mapping({k: e for k, e in body.entries.items() if k not in passed}, body.span)


def _lens(camera: CameraPlan, found: Collector) -> Lens | None:
    written = [key for key in _LENS if getattr(camera, key) is not None]
    missing = [key for key in _LENS if key not in written]
    if camera.calibration is not None and written:
        entries = entries_of(camera.source.node)
        depth = entries["calibration"].depth
        written = [key for key in written if entries[key].depth == depth]
        message = f"the calibration of `{camera.name}` already has its {' and '.join(written)}"
        span = entries[written[0]].key.span
        found.report("KYB385", message.replace("_", " "), span, help="write one of both")
        return None
    if camera.calibration is not None:
        return read_calibration(camera.calibration)
    if camera.width is None or camera.height is None or camera.field_of_view is None:
        hint = "write `width`, `height` and `field_of_view`, or `calibration: FILE`"
        message = f"the camera `{camera.name}` needs `{missing[0]}`"
        found.report("KYB385", message, camera.span, help=hint)
        return None
    return pinhole(camera.width, camera.height, camera.field_of_view)


def pinhole(width: int, height: int, field_of_view: float) -> Lens:
    """Return a lens without distortion, with square pixels and its axis through the middle of the
    image. width, height: pixels. field_of_view: the angle between the image's left and right edges,
    rad."""
    focal = 0.5 * width / tan(0.5 * field_of_view)
    return Lens(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


def written_camera(camera: Camera, calibration: str) -> str:
    """Return an entry of `cameras` as text, to a tenth of a millimetre and a thousandth of a
    degree, with its lens in the file `calibration`."""
    at = ", ".join(f"{metres:.4f} m" for metres in camera.position)
    turned = {name: multiply(camera.attitude, conjugate(quat)) for name, quat in FACING.items()}
    facing = max(FACING, key=lambda name: abs(turned[name][0]))
    angles = zip(("roll", "pitch", "yaw"), to_euler(turned[facing]), strict=True)
    trim = "".join(f", {name}: {degrees(angle):.3f} deg" for name, angle in angles)
    more = f", row_time: {camera.row_time:g} s" if camera.row_time else ""
    return (
        f"{camera.name}: {{at: [{at}], facing: {facing}{trim}, calibration: {calibration},"
        f" rate: {camera.rate:g} Hz{more}}}"
    )
