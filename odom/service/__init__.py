"""The processes that own I/O."""
