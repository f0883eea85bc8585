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
from kybflow.core.errors import FAILED, CommandUnreadable
from kybflow.core.text import did_you_mean

if TYPE_CHECKING:
    from kybflow.command_server.client import RunClient

STATE, WATCH = "state", "watch"
SETTINGS = {"ignore_unknown_options": True}
"""Lets values such as `-0.5m` pass as arguments, although they look like options."""
_TO_VEHICLES = ("pause", "resume", "reset", "land")


def command(
    words: Annotated[
        list[str], Argument(metavar="[RUN] COMMAND...", help="The run, then the command.")
    ],
    take: Annotated[bool, Option("--take", help="Take the lease from another client.")] = False,
    as_json: Annotated[bool, Option("--json", help="Print `state` and `watch` as JSON.")] = False,
) -> None:
    """Give a command to a running mission.

    RUN is the run's folder, its name or its mission's name; by default the only run.

    \b
    emit EVENT                        give an event that the mission waits for
    switch VEHICLE STATE [NAME=VALUE ...]
                                      let a vehicle enter a state, with values
    set OPTION VALUE                  change a parameter of a part
    enable VEHICLE.processors.NAME    switch a processor on
    disable VEHICLE.processors.NAME   switch it off
    perform VEHICLE ACT               let a vehicle perform an act of its driver
    phase FLOW PHASE                  let a flow enter a phase
    pause [VEHICLE ...]               hold until `resume`
    resume [VEHICLE ...]              continue; take control back from a pilot
    reset [VEHICLE ...]               leave `fault`, on the ground
    land [VEHICLE ...]                land for the rest of the run
    stop [REASON]                     land everything and end the run
    track VEHICLE time=S position=[X, Y, Z] ...
                                      send a point of its trajectory
    release                           give up the lease
    state                             print the run's state and legal commands
    watch                             print events as they happen

    The first client to give a command holds the lease. Commands of others are refused until the
    lease is released or taken with --take. `land`, `pause` and `stop` need no lease.

    \b
    Exit codes:
    0: the command was accepted.
    1: it was refused; the reason is on stderr.
    2: the command or the run doesn't exist.

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
    run, given = (None, words) if words[0] in known else (words[0], words[1:])
    if not given:
        hint = did_you_mean(words[0], known)
        raise WrongUsage(f"`{words[0]}` is not a command, or is a run without a command; {hint}")
    line = " ".join(given)
    if line not in (STATE, WATCH):
        try:
            parse(line)
        except CommandUnreadable as error:
            raise WrongUsage(str(error)) from None
    with (
        failing(FAILED, CommandRefused, word="refused: "),
        RunClient(find_run(run), commander_here(), keeps_lease=True) as client,
    ):
        if line == STATE:
            found = client.state()
            echo(json.dumps(found, indent=2) if as_json else "\n".join(described(found)))
        elif line == WATCH:
            _watch(client, as_json=as_json)
        else:
            answer = client.command(line, take=take)
            echo(f"accepted, but {answer.reason}" if answer.reason else "accepted")


def _watch(client: RunClient, *, as_json: bool) -> None:
    """Print the events of a run as they happen."""
    from kybflow.cli.printing.flights import sentence
    from kybflow.core.signals import NS, Event

    for one in client.watch():
        if as_json:
            echo(json.dumps(one))
        else:
            time = round(one["t_s"] * NS)
            echo(sentence(Event(time, one["event"], one["vehicle"], one["fields"], one["at"])))
        sys.stdout.flush()


def described(situation: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines that describe a run's state and legal commands. situation: the decoded JSON of
    `state`."""
    holder = situation["holder"]
    commander = f"commanded by {holder}" if holder else "no client holds the lease"
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
        idle = {True: "", False: " (nothing waits for it now)"}
        yield f"events to emit: {', '.join(name + idle[now] for name, now in emit.items())}"


_HELD = {
    "holders": "held by {}",
    "braking": "braking: {}",
    "latched": "failsafe until a reset: {}",
    "override": "under other control: {}",
    "retired": "landing for the rest of the run: {}",
    "driver": "driven by the flow {}",
}
"""The reasons why a vehicle doesn't follow its state."""


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
    """Yield a line with what may be entered, then a line for each reason why the rest may not."""
    reasons = grouped((reason or "", name) for name, reason in enter.items())
    if legal := reasons.pop("", None):
        yield f"  {what} {', '.join(legal)}"
    for reason, names in reasons.items():
        yield f"  not {', '.join(f'`{name}`' for name in names)}: {reason}"
