"""People who walk from site to site: what this site tells the others, and what it hears from them."""
