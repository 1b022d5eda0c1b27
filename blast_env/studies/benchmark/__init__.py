"""How fast the engines and the environment are."""
