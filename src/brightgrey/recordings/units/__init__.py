"""Units: parsing of their texts, and their conversion at the edge."""
