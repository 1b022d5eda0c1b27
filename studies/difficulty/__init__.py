"""The study of the scenarios' difficulty, `python -m studies.difficulty`."""
