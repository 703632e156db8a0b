"""The figures and tables of Xiong, Wang and Liu (2020), drawn from computed data."""
