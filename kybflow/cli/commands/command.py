"""`kybflow command`."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import Subcommand, argument, examples
from kybflow.cli.output import echo
from kybflow.core.errors import CommandUnreadable
from kybflow.core.exit_codes import FAILED
from kybflow.core.text import did_you_mean

if TYPE_CHECKING:
    from kybflow.command_server.client import RunClient

STATE, WATCH = "state", "watch"
EXAMPLES = examples(
    "kybflow command emit operator.go",
    "kybflow command figure_eight switch mk down",
    "kybflow command switch mk goto 'position=[1, 0, 1]' speed=50cm/s",
    "kybflow command runs/figure_eight-20260301-101500 set mk.processors.limit_speed.speed 50cm/s",
    "kybflow command state",
    "kybflow command watch --json",
)


@click.command(
    "command",
    cls=Subcommand,
    epilog=EXAMPLES,
    context_settings={"ignore_unknown_options": True},  # `set OPTION -0.5m` is no option
)
@argument(
    "words",
    "The run, then the command. RUN: its folder, its name or its mission's; left out, the only run "
    "that flies.",
    nargs=-1,
    required=True,
    type=click.UNPROCESSED,
    metavar="[RUN] COMMAND...",
)
@click.option("--take", is_flag=True, help="Take the lease from another who commands the run.")
@click.option("--json", "as_json", is_flag=True, help="`state` and `watch` as JSON.")
def command(words: tuple[str, ...], take: bool, as_json: bool) -> None:
    """Give a command to a mission that flies.

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
    """
    from kybflow.command_server.address import find_run
    from kybflow.command_server.client import CommandRefused, RunClient
    from kybflow.runtime.commanding.orders import WORDS, parse

    known = (*WORDS, STATE, WATCH)
    run, spoken = (None, words) if words[0] in known else (words[0], words[1:])
    if not spoken:
        hint = did_you_mean(words[0], known)
        raise click.UsageError(f"`{words[0]}` is no command, and nothing follows it; {hint}")
    asked = " ".join(spoken)
    if asked not in (STATE, WATCH):
        try:
            parse(asked)
        except CommandUnreadable as error:
            raise click.UsageError(str(error)) from None
    try:
        with RunClient(find_run(run), commander(), keeps_lease=True) as client:
            _give(client, asked, take=take, as_json=as_json)
    except CommandRefused as error:
        echo(f"refused: {error}", err=True)
        raise Exit(FAILED) from None


def _give(client: RunClient, asked: str, *, take: bool, as_json: bool) -> None:
    if asked == STATE:
        _show(client, as_json=as_json)
    elif asked == WATCH:
        _watch(client, as_json=as_json)
    else:
        answer = client.command(asked, take=take)
        echo(f"accepted, but {answer.reason}" if answer.reason else "accepted")


def _show(client: RunClient, *, as_json: bool) -> None:
    import json

    from kybflow.cli.printing.situation import described

    found = client.state()
    echo(json.dumps(found, indent=2) if as_json else "\n".join(described(found)))


def _watch(client: RunClient, *, as_json: bool) -> None:
    import json

    from kybflow.cli.printing.run import sentence
    from kybflow.core.signals import NS, Event

    for said in client.watch():
        if as_json:
            echo(json.dumps(said))
        else:
            time = round(said["t_s"] * NS)
            echo(sentence(Event(time, said["event"], said["vehicle"], said["fields"], said["at"])))
        sys.stdout.flush()


def commander() -> str:
    """Who commands from here: the user, and the terminal or the session, so that all commands from
    one shell are of one commander."""
    from kybflow.command_server.client import printable
    from kybflow.command_server.connected_client import user_name

    try:
        place = f"at {os.ttyname(0).removeprefix('/dev/')}"
    except OSError:
        place = f"in session {os.getsid(0)}"
    return printable(f"{user_name(os.geteuid())} {place}")
