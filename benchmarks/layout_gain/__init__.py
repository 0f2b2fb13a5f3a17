"""What a layout term could gain, and what one between companions does gain."""
