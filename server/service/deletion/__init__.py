"""Deletion of a person's data on request: from memory, cameras, other services, recordings and files."""
