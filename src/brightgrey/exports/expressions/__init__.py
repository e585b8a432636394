"""Effect laws as expressions, and their text in other languages."""
