"""Images to point pairs with covariances: features, tracks, matching."""
