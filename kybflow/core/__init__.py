"""Signals, geometry, units, parameters, files, hints for unknown names, errors and exit codes.
Imports nothing from the rest of kybflow; every module may import it.
"""
