"""Diagnostics: what one is, the span that it marks, and how it is rendered for people and for
programs. Every other folder of the compiler makes diagnostics; none is made here.
"""
