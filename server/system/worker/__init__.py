"""Worker processes: a module in another process that answers requests over its standard input and output."""
