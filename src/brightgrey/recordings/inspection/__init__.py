"""Inspection of a file: what each channel holds and might be, and which of them an identification would use."""
