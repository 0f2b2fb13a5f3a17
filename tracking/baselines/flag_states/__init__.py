"""The state machine that flags targets for an operator (Todor 2009, section 8.2)."""
