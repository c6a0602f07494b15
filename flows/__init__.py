"""Which task follows which: flows that read as prose, and the command line."""
