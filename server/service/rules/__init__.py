"""Rules on the decisions of a site: zones in the unit of the ground, positions of people, events."""
