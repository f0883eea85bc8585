"""The runtime flies a compiled plan. The engine controls time and the order of execution and
handles failures; parts are passive. The runtime never imports recording, report or the command
line.
"""
