"""Commands to a run from other programs of the same user, over a local socket.

`protocol` converts messages from and to bytes. `address` creates and finds the socket, in a folder
that only its user may enter. `server` serves a run in a thread that never delays the tick;
`connected_client` is one of its clients. `client` sends commands and imports nothing that flies.
`kybflow.runtime.commanding` executes the commands.
"""
