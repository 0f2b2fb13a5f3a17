"""How fast recordings are rendered, and where the processor time goes."""
