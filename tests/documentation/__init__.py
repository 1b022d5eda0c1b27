"""What the pages show: read by the tests, run by `make docs` (tests.documentation.run)."""
