"""The exit codes of a command that was told to stop: 128 and the signal's number, as shells have it."""

INTERRUPTED = 130
TERMINATED = 143
