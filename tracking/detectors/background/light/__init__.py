"""How the light of a frame differs from the background's, so that changes of the light are no people."""
