"""From load to consequence: what breaks, what stands, and what that costs."""
