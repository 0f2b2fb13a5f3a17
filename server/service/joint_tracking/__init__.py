"""Joint tracking of the people on the common ground of several cameras, between ingest and identity."""
