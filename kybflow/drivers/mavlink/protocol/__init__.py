"""Pure: frames, signatures, and the fields of messages to and from kybflow's values. No socket, no
clock.
"""
