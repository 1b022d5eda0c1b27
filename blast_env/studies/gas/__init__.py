"""What was checked about the gas engine: docs/gas.md has the results."""
