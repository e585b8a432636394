"""Options of the command line, and their conversion to values."""
