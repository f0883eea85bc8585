"""Navigation data: a header, options each with a tag and a size, and a checksum.

`packet` cuts a datagram into its options and says why it refuses one; `options` decodes those that
are used; `state` has the bits of the header's mask and the states of flight.
"""
