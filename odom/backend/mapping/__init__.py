"""How the map grows and is adjusted: key frames are inserted, bundles adjusted, places described."""
