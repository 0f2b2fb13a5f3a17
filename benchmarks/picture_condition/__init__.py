"""How soon a camera says what is wrong with its picture, and how often wrongly."""
