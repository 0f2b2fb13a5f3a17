"""HTTP requests to a served site."""
