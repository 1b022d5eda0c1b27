"""The page to design on: `blast-env app`.

From the bottom up: edits of a site (`edits`, `placing`), a design with undo and redo (`design`),
its folder (`folder`), work in processes (`jobs`, `tasks`, `blasts`), the content of the
page (`plan`, `solids`, `records`), and the page itself (`page`, NiceGUI).
"""
