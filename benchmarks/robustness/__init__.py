"""What disturbances of the picture cost: detection, tracks, identities, views, and time to recovery."""
