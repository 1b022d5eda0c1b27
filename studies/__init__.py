"""Commands behind the claims of the documentation, one file or package per question.

Part of the repository only: the wheel contains none of it, and the package imports none of it.
"""
