"""Who is who: from every camera's own tracks to one number per person, which they keep."""
