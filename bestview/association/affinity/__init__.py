"""How likely two tracklets are one person: the evidence, weighed and added up."""
