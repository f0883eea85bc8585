"""Aerial manipulation: whether a vehicle touches a surface, how several share the force that moves
an object, and the way round it."""
