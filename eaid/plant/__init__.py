"""The one plant: its forms over the input, its dynamics, what it answers, and how it is around a held input."""
