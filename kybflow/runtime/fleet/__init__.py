"""Everything that concerns several vehicles or the whole run: flows, callbacks, inputs, moving
obstacles, fault injection, collisions, hard landings and released payloads. The engine calls these
once a tick.
"""
