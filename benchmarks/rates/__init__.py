"""What lower and higher frame rates cost."""
