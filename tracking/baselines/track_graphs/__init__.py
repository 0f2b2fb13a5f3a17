"""Track graphs: identities through merges into groups of people and splits from them."""
