"""How far a solution can be trusted: the mesh's error, material stability, sharp edges."""
