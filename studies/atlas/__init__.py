"""The atlas of shielding: blasts of a designed experiment, and the laws fitted to them."""
