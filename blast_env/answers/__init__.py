"""Answers in words: documents made of the results of questions, and three renderers of them."""

from blast_env.answers.document import (
    AnyPart,
    Document,
    Line,
    Number,
    Picture,
    Section,
    Table,
)
from blast_env.answers.left_out import left_out_words, nearer_words

__all__ = [
    "AnyPart",
    "Document",
    "Line",
    "Number",
    "Picture",
    "Section",
    "Table",
    "left_out_words",
    "nearer_words",
]
