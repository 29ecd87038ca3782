"""Plans that come with tacdata, one per file; `tacdata plan NAME` writes them."""
