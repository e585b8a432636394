"""Findings about a fit: its outcome, cautions, equivalent models, and symptoms in the residual."""
