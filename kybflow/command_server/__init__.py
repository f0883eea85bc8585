"""Commands to a run from other programs of the same user, over a local socket.

`protocol` is pure: bytes to values and back. `address` makes the socket in a folder that only its
user may enter, and finds it again; `connected_client` is one client as the server sees it; `server`
serves a run in a thread of its own, which hands values to the run's command queue and never holds
up the tick; `client` gives commands, without loading anything that flies. The command line and the
API join a server with a flight; `kybflow.runtime.commanding` decides what a command means.
"""
