"""What choosing views costs, and how it grows."""
