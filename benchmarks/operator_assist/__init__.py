"""An operator who is asked where identities are about to fail (Todor, chapter 8)."""
