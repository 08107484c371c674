"""What a user asks for, from input to written results: one module per command."""
