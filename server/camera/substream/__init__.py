"""A camera's second, smaller stream, in which people are detected and tracked."""
