"""The connection to one drone.

`stream` numbers commands and replaces outdated ones. `wire` filters navigation data and defines the
interface of a connection, which `udp` implements over UDP and TCP with a thread.
"""
