"""Diagnostics: what one is, the span that it marks, how it is rendered for people and for programs,
and what each code means. Every other folder of the compiler makes diagnostics; none is made here.
"""
