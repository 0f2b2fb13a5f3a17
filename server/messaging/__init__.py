"""Messages between the processes, and the zenoh bus that carries them."""
