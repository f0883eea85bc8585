"""What is on board an emulated drone: it hears AT commands, estimates, flies, and tells.

None of it knows a socket, and none reads the simulator's truth but the models of its sensors.
"""
