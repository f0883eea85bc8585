"""Commands to a run from other programs of the same user, over a local socket.

`protocol` converts bytes to values and back. `address` creates and finds the socket, in a folder
that only its user may enter. `server` serves a run in its own thread, which never holds up the
tick; `connected_client` is one client of it. `client` gives commands without importing anything
that flies. `kybflow.runtime.commanding` executes the commands.
"""
