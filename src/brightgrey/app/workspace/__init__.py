"""A workspace: a folder of projects, each with its recordings, its runs, and one document that says what was chosen."""
