"""Bytes to and from one drone.

`stream` numbers what is sent and knows how old a command may be, `gate` admits navigation data, and
a `DroneWire` has both: over UDP and TCP with a thread (`udp`), or in this process.
"""
