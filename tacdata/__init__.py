"""tacdata: the data engine for soft tactile skins."""
