"""Plans that come with tacdata, one file each; `tacdata plan NAME` writes them out."""
