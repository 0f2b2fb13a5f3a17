"""The page on a running site: switching people, and memory over a visit and over hours."""
