"""Who may watch and operate."""
