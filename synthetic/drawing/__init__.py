"""Drawing a scene: ray casting, figures, shadows, compositing."""
