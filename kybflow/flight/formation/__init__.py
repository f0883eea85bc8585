"""Formations: the places of a shape, who takes which, and the frame in which they lie and move.

Pure maths: who publishes what to whom is in `kybflow.runtime.behaviors.formation`.
"""
