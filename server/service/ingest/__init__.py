"""What arrives from the cameras: validated, aligned by epoch, losses recorded."""
