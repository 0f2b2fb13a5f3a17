"""Video and JPEG streams over HTTP."""
