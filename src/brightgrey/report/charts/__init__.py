"""Charts of the report, one file each."""
