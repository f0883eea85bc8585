"""Bytes to and from autopilots: UDP, TCP and serial wires, and the router that gives each autopilot
its port. This package handles MAVLink frames (`protocol`), not their meaning. The session,
discovery and the emulator open their wires here.
"""
