"""Joins plan, drivers, engine and recording: validate, open, inspect, fly. The command line and
studies call it; nothing below does.
"""
