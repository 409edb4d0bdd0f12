"""Jobs forked from one warm process: the server, and what asks it."""
