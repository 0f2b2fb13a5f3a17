"""The connections that are taken: how many, of whom, and for how long they may ask for nothing."""
