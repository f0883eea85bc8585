"""Commands of a person to a run, and their answers: the commands, the queue in which they wait for
the tick, the lease, and what is legal now. Has no threads and no sockets: those that serve commands
(a socket, keys, a schedule, a record that is flown again) use the queue."""
