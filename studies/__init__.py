"""What the documentation claims and the commands behind it, one file or package a question.

Of the repository: nothing here is in the wheel, and nothing of the package imports it.
"""
