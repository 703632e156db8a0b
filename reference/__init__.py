"""The reference: the bicycle's equations after Xiong, Wang and Liu (2020)."""
