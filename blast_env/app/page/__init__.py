"""The page itself, with NiceGUI: panels, plan, results; the logic is in the layers below."""
