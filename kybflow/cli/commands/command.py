"""`kybflow command`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from math import degrees
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from kybflow.cli.arguments import WrongUsage, failing
from kybflow.cli.output import echo, grouped
from kybflow.core.errors import CommandUnreadable
from kybflow.core.exit_codes import FAILED
from kybflow.core.text import did_you_mean

if TYPE_CHECKING:
    from kybflow.command_server.client import RunClient

STATE, WATCH = "state", "watch"
SETTINGS = {"ignore_unknown_options": True}
"""`set OPTION -0.5m` is no option."""
_TO_VEHICLES = ("pause", "resume", "reset", "land")


def command(
    words: Annotated[
        list[str], Argument(metavar="[RUN] COMMAND...", help="The run, then the command.")
    ],
    take: Annotated[bool, Option("--take", help="Take the lease from another commander.")] = False,
    as_json: Annotated[bool, Option("--json", help="`state` and `watch` as JSON.")] = False,
) -> None:
    """Give a command to a mission that flies.

    RUN is its folder, its name or its mission's; left out, it is the only run that flies.

    \b
    emit EVENT                        give an event that the mission waits for
    switch VEHICLE STATE [NAME=VALUE ...]
                                      let a vehicle enter a state, with other values
    set OPTION VALUE                  change a parameter of a part
    enable VEHICLE.processors.NAME    switch a processor on
    disable VEHICLE.processors.NAME   switch it off
    perform VEHICLE ACT               let a vehicle perform an act of its driver
    phase FLOW PHASE                  let a flow enter a phase
    pause [VEHICLE ...]               hold, until `resume`
    resume [VEHICLE ...]              go on; ask back from a pilot who took over
    reset [VEHICLE ...]               out of `fault`, on the ground
    land [VEHICLE ...]                land for the rest of the run
    stop [REASON]                     land everything and end the run
    track VEHICLE time=S position=[X, Y, Z] ...
                                      a point of the trajectory that it takes
    release                           give up the lease
    state                             what it does and what is legal now
    watch                             events as they come

    Who commands first holds the lease: others are refused until it is released, or they `--take`
    it. `land`, `pause` and `stop` are heard from anyone.

    \b
    Exit codes:
    0: accepted.
    1: refused, the reason is on stderr.
    2: no such command, or no such run.

    \b
    Examples:
      kybflow command emit operator.go
      kybflow command figure_eight switch mk down
      kybflow command switch mk goto 'position=[1, 0, 1]' speed=50cm/s
      kybflow command runs/figure_eight-20260301-101500 set mk.processors.limit_speed.speed 50cm/s
      kybflow command state
      kybflow command watch --json
    """
    from kybflow.command_server.address import find_run
    from kybflow.command_server.client import CommandRefused, RunClient, commander_here
    from kybflow.runtime.commanding.orders import WORDS, parse

    known = (*WORDS, STATE, WATCH)
    run, spoken = (None, words) if words[0] in known else (words[0], words[1:])
    if not spoken:
        hint = did_you_mean(words[0], known)
        raise WrongUsage(f"`{words[0]}` is no command, and nothing follows it; {hint}")
    asked = " ".join(spoken)
    if asked not in (STATE, WATCH):
        try:
            parse(asked)
        except CommandUnreadable as error:
            raise WrongUsage(str(error)) from None
    with (
        failing(FAILED, CommandRefused, word="refused: "),
        RunClient(find_run(run), commander_here(), keeps_lease=True) as client,
    ):
        if asked == STATE:
            found = client.state()
            echo(json.dumps(found, indent=2) if as_json else "\n".join(described(found)))
        elif asked == WATCH:
            _watch(client, as_json=as_json)
        else:
            answer = client.command(asked, take=take)
            echo(f"accepted, but {answer.reason}" if answer.reason else "accepted")


def _watch(client: RunClient, *, as_json: bool) -> None:
    """Print the events of a run as they come."""
    from kybflow.cli.printing.run import sentence
    from kybflow.core.signals import NS, Event

    for said in client.watch():
        if as_json:
            echo(json.dumps(said))
        else:
            time = round(said["t_s"] * NS)
            echo(sentence(Event(time, said["event"], said["vehicle"], said["fields"], said["at"])))
        sys.stdout.flush()


def described(situation: Mapping[str, Any]) -> Iterator[str]:
    """What a run does and what may be asked of it now, in lines. situation: as JSON has it."""
    holder = situation["holder"]
    commander = f"commanded by {holder}" if holder else "nobody holds the lease"
    flying = "" if situation["flying"] else ", preflight"
    yield f"{situation['mission']}   {situation['time']:.1f} s{flying}, {commander}"
    for vehicle in situation["vehicles"]:
        yield from _vehicle(vehicle)
    for flow in situation["flows"]:
        phase = f"{flow['phase']} for {flow['elapsed']:.1f} s" if flow["phase"] else "in no phase"
        yield f"{flow['name']}   {phase}, drives {', '.join(flow['vehicles']) or 'nothing'}"
        yield from _entries(flow["enter"], "may enter phase")
        if flow["waits_for"]:
            yield f"  waits for {', '.join(flow['waits_for'])}"
    if emit := situation["emit"]:
        waits = (
            f"{name}{'' if now else ' (nothing waits for it now)'}" for name, now in emit.items()
        )
        yield f"events to emit: {', '.join(waits)}"


_HELD = {
    "holders": "held by {}",
    "braking": "brakes: {}",
    "latched": "failsafe: {}, until a reset",
    "override": "somebody else has control: {}",
    "retired": "lands for the rest of the run: {}",
    "driver": "driven by the flow {}",
}
"""Why a vehicle doesn't do what its state says."""


def _vehicle(vehicle: Mapping[str, Any]) -> Iterator[str]:
    state = "not begun"
    if vehicle["state"]:
        state = f"{vehicle['state']} ({vehicle['behavior']}) for {vehicle['elapsed']:.1f} s"
    facts = [state, vehicle["flight"]]
    if vehicle["battery"] is not None:
        facts.append(f"battery {vehicle['battery']:.0%}")
    yield f"{vehicle['name']}   {', '.join(facts)}"
    if (estimate := vehicle["estimate"]) is not None:
        where = ", ".join(f"{x:.2f}" for x in estimate["position"])
        heading = f"heading {degrees(estimate['heading']):.0f} deg"
        yield f"  at ({where}) m, {heading}, by {estimate['estimator'] or 'no estimator'}"
    for key, words in _HELD.items():
        if value := vehicle[key]:
            yield f"  {words.format(', '.join(value) if key == 'holders' else value)}"
    yield from _entries(vehicle["enter"], "may enter")
    if vehicle["waits_for"]:
        yield f"  waits for {', '.join(vehicle['waits_for'])}"
    legal = [word for word in _TO_VEHICLES if vehicle[word] is None]
    yield f"  legal: {', '.join(legal) or 'nothing'}"
    for word in _TO_VEHICLES:
        if vehicle[word] is not None:
            yield f"  not `{word}`: {vehicle[word]}"


def _entries(enter: Mapping[str, str | None], what: str) -> Iterator[str]:
    """What may be entered, then the rest by the reason why not."""
    reasons = grouped((reason or "", name) for name, reason in enter.items())
    if legal := reasons.pop("", None):
        yield f"  {what} {', '.join(legal)}"
    for reason, names in reasons.items():
        yield f"  not {', '.join(f'`{name}`' for name in names)}: {reason}"
