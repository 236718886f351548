"""Places seen again: recognised, verified, held against the chain, and closed."""
