"""Keys in the terminal where a mission flies: a person acts on it with one hand. The terminal and
what it sends, which key means which command, and the commander that gives them. It is read between
ticks, without a thread, and asks the queue that all commanders ask."""
