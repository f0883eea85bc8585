"""What a person asks of a run while it flies, and the answers: the commands, the queue in which
they wait for the tick, who holds the lease, and what is legal now. No thread and no socket: whoever
serves commands (a socket, keys, a schedule, a record flown again) uses the queue."""
