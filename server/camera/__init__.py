"""One camera: take, encode once, find, follow, publish."""
