"""Floor plans in the formats of other programs."""
