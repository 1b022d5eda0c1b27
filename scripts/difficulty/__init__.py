"""What the study of the scenarios, `scripts.scenario_difficulty`, is made of."""
