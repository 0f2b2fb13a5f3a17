"""Operator assistance: a simulated operator helps where identities are about to fail (Todor, chapter 8)."""
