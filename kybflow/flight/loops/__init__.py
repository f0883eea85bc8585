"""The position loop as a linear system: its frequency response, its stability margins, and the
design of its gains.

Nothing here is called in a tick: trackers get gains when they are created, the compiler and
`kybflow show` get margins.
"""
