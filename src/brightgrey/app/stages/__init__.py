"""The six stages of the app: drive, recording, check, search, results, hand over."""
