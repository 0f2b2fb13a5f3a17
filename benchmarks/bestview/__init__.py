"""Who is who across cameras, and the best view of everybody."""
