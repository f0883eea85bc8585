"""Nothing that flies reads the simulator's truth: a truth that lies changes no command."""

from __future__ import annotations

from plans import part, state, then, vehicle, wrapped
from short_flights import down, path, up

from kybflow.core.signals import Command, Truth
from kybflow.parts import Link


class Watched(Link):
    """A link that notes the commands and may lie about the truth."""

    def __init__(self, link: Link, lies: bool, commands: list[Command]) -> None:
        self._link, self._lies, self._commands = link, lies, commands

    def read(self, now):
        return self._link.read(now)

    def send(self, command, now):
        self._commands.append(command)
        self._link.send(command, now)

    def truth(self):
        truth = self._link.truth()
        lie = Truth((9.0, 9.0, 9.0), (5.0, 5.0, 5.0), (0.0, 1.0, 0.0, 0.0), (7.0, 7.0, 7.0))
        return lie if self._lies else truth


def commands(run, lies: bool) -> list[Command]:
    told: list[Command] = []

    driver = wrapped(lambda _, link: Watched(link, lies, told))
    eight = part("behaviors", "figure_eight", width=1.0, lap=8.0)
    states = [up("eight"), state("eight", eight, then("down")), down()]
    _, heard = run(vehicle("a", states, driver=driver))
    assert path(heard, "a") == ["up", "eight", "down", "landed"]
    return told


def test_a_truth_that_lies_changes_no_command(run):
    honest = commands(run, lies=False)
    assert len(honest) > 2000
    assert commands(run, lies=True) == honest
