"""The MAVLink side of an emulated autopilot: its channels, the handlers of received messages, and
the messages that it sends.

`endpoint` connects them to the autopilot; only the session and `kybflow emulate` call it.
"""
