"""Background-subtraction detector: background models, foreground fit, height model."""
