"""A basketball court and the players on it."""
