"""Files of other programs: maps and drawings in, drawings and tables out."""
