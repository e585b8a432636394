"""Exports: a model as files for other tools, each checked by the tool it is made for."""
