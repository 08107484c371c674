"""Stage C with fitted borders: atoms of the floor joined to rooms by one fitted strength."""
