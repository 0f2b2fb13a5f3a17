"""A small room under an overhead camera."""
