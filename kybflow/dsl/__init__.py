"""The mission language: text to plan. `compiler` lists the passes; each has a folder.

Never imports the runtime or a driver: it is given a catalog of parts.
"""
