"""The software on board an emulated drone: commands, estimation, flight and navigation data.

It has no sockets, and only its sensor models read the simulator's true state.
"""
