"""Bytes to and from autopilots: datagrams, TCP, serial lines, and the router between them."""
