"""From the cameras' tracks to one id per person: tracklets, affinity, clustering, registry."""
