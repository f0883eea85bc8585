"""Flies a plan. The engine owns time, order and failure; parts are passive. Never imports
recording, report or the command line.
"""
