"""What no structure offered explains: signs of it in a residual, and effects that follow it without being there."""
