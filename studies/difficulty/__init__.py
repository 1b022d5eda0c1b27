"""What the study of the scenarios, `studies.difficulty`, is made of."""
