"""What the processes say to each other, and how they are configured."""
