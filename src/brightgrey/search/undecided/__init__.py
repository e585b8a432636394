"""What a search left undecided, in numbers that the next motion can be designed with."""
