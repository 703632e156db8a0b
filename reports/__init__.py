"""Measurements of rides, and their presentation: drawings, figures, recordings, report pages, conformance reports."""
