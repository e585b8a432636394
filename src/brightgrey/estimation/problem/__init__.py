"""The least-squares problem of a structure on recordings: residuals, parameters, initial states."""
