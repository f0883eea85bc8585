"""Formations: the places of a shape, the assignment of vehicles to them, and the frame in which
they lie and move.

This is pure maths; `kybflow.runtime.behaviors.formation` contains what members publish and to whom.
"""
