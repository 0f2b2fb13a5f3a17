"""Live cameras: whether tracking keeps up, and what each stage costs."""
