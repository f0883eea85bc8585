"""Expand one vehicle: its airframe with cameras, its parts, its states."""

from __future__ import annotations

from math import degrees, tan

from kybflow.core.geometry import Quat, conjugate, from_axes, from_euler, multiply, to_euler
from kybflow.dsl.calibration_file import read_calibration
from kybflow.dsl.diagnostics import Findings, Span
from kybflow.dsl.expanding.states import states_of
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.plan import Body, ChainPlan, PartPlan, Start, StatePlan, VehiclePlan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar, entries_of
from kybflow.dsl.world import CameraPlan
from kybflow.parts.observables import chains_of
from kybflow.world.cameras import DOWN, Camera, Lens

CODES = {
    "KYB385": "A camera whose lens is not described, or twice in one place: it has `calibration`, "
    "or `width`, `height` and `field_of_view`. Of what came through `like`, the nearer one counts.",
}
_LENS = ("width", "height", "field_of_view")
_DOWNWARD = (0.0, 0.0, -1.0)
FACING: dict[str, Quat] = {
    "down": DOWN,
    "up": from_axes((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "forward": from_axes((0.0, -1.0, 0.0), _DOWNWARD, (1.0, 0.0, 0.0)),
    "backward": from_axes((0.0, 1.0, 0.0), _DOWNWARD, (-1.0, 0.0, 0.0)),
    "left": from_axes((1.0, 0.0, 0.0), _DOWNWARD, (0.0, 1.0, 0.0)),
    "right": from_axes((-1.0, 0.0, 0.0), _DOWNWARD, (0.0, -1.0, 0.0)),
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


def body_of(name: str, head: Span, node: Mapping, decoder: Decoder) -> Body | None:
    """Return an airframe with its cameras, without the cameras that have errors; None if the
    airframe itself has errors."""
    cameras = [_camera(e, decoder) for e in entries_of(node.get("cameras")).values()]
    kept = tuple(camera for camera in cameras if camera is not None)
    body: Body = decoder.record(Body, node, head, name=name, cameras=kept)
    return body if body.airframe else None


def _camera(entry: MappingEntry, decoder: Decoder) -> CameraPlan | None:
    if not isinstance(entry.value, Mapping):
        return None
    name, body = entry.key, _with_nearest_lens(entry.value)
    camera: CameraPlan | None = decoder.record(CameraPlan, body, name.span, name=name.text)
    lens = None if camera is None else _lens(camera, decoder.found)
    if camera is None or lens is None:
        return None
    attitude = multiply(from_euler(camera.roll, camera.pitch, camera.yaw), FACING[camera.facing])
    made = Camera(name.text, lens, camera.at, attitude, camera.rate, camera.row_time)
    return camera.but(camera=made)


def _with_nearest_lens(body: Mapping) -> Mapping:
    """Return the camera's mapping with only one description of the lens: of a calibration and a
    written lens, the one from fewer `like` steps away."""
    lens = [body.entries[key] for key in _LENS if body.get(key) is not None]
    if not lens or body.get("calibration") is None:
        return body
    own, other = body.entries["calibration"].depth, min(entry.depth for entry in lens)
    passed = _LENS if own < other else ("calibration",) if own > other else ()
    return Mapping({k: e for k, e in body.entries.items() if k not in passed}, body.span)


def _lens(camera: CameraPlan, found: Findings) -> Lens | None:
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
