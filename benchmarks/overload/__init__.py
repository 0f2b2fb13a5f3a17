"""More cameras than the machine carries: what is left out, and the way back."""
