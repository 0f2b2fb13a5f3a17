"""The JSON API: handlers, responses, schemas, events."""
