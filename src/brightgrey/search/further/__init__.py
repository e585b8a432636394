"""Further effects: which of those that a function set holds back a search is offered."""
