"""The page itself, with NiceGUI: panels, plan, results; all decisions are below."""
