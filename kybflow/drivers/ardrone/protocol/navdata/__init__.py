"""Navigation data: a header, options with a tag and a size each, and a checksum.

`packet` splits a datagram into its options, `options` decodes those that a flight needs, `layouts`
lists the fields of all options, and `state` defines the bits of the state mask and the flight
phases.
"""
