"""Messages from the zenoh bus."""
