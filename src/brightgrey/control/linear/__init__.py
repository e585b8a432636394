"""Linear analysis at an operating point: poles, margins, controllability."""
