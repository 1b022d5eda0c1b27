"""The page to design on: `blast-env app`.

From the bottom up: edits of a site (`edits`, `placing`), a design with undo and redo (`design`),
the folder that keeps it (`folder`), work in processes of its own (`jobs`, `worker`, `tasks`), what
the page shows (`plan`, `solids`, `records`), and the page itself (`page`, NiceGUI).
"""
