"""Which effects the residual asks for: gate, race, elimination, rivals, leftovers."""
