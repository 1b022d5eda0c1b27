"""The particle model of Martyniuk & Kochkarov: engines, collision tables and calibration."""
