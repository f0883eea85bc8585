"""Commands a running mission from Python.

    from kybflow.api.commands import connect

    with connect("figure_eight") as run:
        run.pause()
        run.switch("mk", "down")
        print(run.state()["vehicles"][0]["state"])

Every run of `kybflow run` accepts commands. A run of `fly` needs a `CommandServer`:
`fly(plan, request, [server.on_event], servers=[server.serve])`.
"""

from kybflow.command_server.address import RunNotFound
from kybflow.command_server.client import CommandRefused, RunClient, RunUnreachable, connect
from kybflow.command_server.server import CommandServer

__all__ = [
    "CommandRefused",
    "CommandServer",
    "RunClient",
    "RunNotFound",
    "RunUnreachable",
    "connect",
]
