"""Imports of a folder of anybody's maps and drawings, with the sums of their ledgers."""
