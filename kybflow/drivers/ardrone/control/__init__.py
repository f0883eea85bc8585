"""What is asked of a drone: moves, taking off and landing, its configuration, answers to time.

Plain objects that take the drone's status and the time; they know no socket.
"""
