"""Models of coloured residuals, whitening, and tests for whiteness."""
