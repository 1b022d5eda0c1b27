"""The choice of a layout: proposals, searches and what the atlas says of them."""
