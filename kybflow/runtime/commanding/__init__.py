"""A person's commands to a run and their answers: the commands, the queue in which they wait for
the next tick, the lease, and which commands are legal now. This package has no threads and no
sockets; the sources of commands (a socket, keys, a schedule, a recording that is flown again) put
them into the queue."""
