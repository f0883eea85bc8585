"""The runtime flies a compiled plan. The engine owns time, order and failures; parts are passive.
It never imports recording, report or the command line.
"""
