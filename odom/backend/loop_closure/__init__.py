"""Places seen again: recognised, verified, compared with the chain, and closed."""
