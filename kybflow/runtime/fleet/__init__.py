"""What concerns several vehicles or the whole run: flows, callbacks, the operator, fault injection,
collisions, hard landings and released payloads. The engine calls them once a tick.
"""
