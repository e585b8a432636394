"""Who may ask the server for something, and what may be uploaded."""
