"""The page on a running site: switching people, memory over a visit, hours of it."""
