"""Reference loads, the laws that scale simulated impulses to them, and their agreement."""
