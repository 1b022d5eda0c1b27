"""The choice of a layout: rules, optimisers, and the surrogate of the gas engine."""
