"""Command line. Each command is one call into the public face; heavy imports happen inside the commands."""

from brightgrey.cli.program import app, main

__all__ = ["app", "main"]
