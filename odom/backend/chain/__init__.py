"""The paper's chain: every frame registered against the one before it, C_i+1 against C_i, by the robust filter."""
