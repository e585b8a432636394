"""Report: tables, figures and the page that shows a model to people."""
