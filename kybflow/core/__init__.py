"""Signals, geometry, units, parameters, files, hints for unknown names, and errors. Imports nothing
from the rest of kybflow; every module may import it.
"""
