"""virtual_rig."""
