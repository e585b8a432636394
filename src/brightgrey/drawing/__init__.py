"""Drawing of a drive: its parts, their places, and the picture as SVG.

`drive` says what is drawn, `layout` where, as boxes that a test can compare, and `svg` writes it.
"""
