"""Compiled kernels: plain loops and scalars, generic over real and complex numbers.

Everything here runs on float64 and on complex128 alike, since derivatives are taken by the complex
step: no conjugation, no absolute value, comparisons on real parts only.
"""
