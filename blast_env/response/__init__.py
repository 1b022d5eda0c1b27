"""From load to consequence: response and damage of facades, barriers, buildings and people."""
