"""What was checked about the gas engine: docs/engineers/gas.md has the results."""
