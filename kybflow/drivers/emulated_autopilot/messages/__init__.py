"""The MAVLink side of an emulated autopilot: its channels, the handlers of what it receives, and
the messages that it sends.

`endpoint` joins them with the autopilot; only the session and `kybflow emulate` call it.
"""
