"""The ground plane, and what cameras can see of people who stand on it."""
