"""Where an emulated drone speaks: in memory, or at the ports of a real one."""
