"""The position loop as a linear system: its frequency response, its margins, and gains by them.

Nothing here is called in a tick. Trackers ask for gains when they are made, the compiler and
`kybflow show` for margins.
"""
