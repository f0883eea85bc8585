"""What concerns several vehicles or the whole run: flows, callbacks, the operator, faults at work,
collisions and released payloads. Called by the engine once a tick.
"""
