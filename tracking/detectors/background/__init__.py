"""People as foreground: background models, foreground explanation, height model."""
