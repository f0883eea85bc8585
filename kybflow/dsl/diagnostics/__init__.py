"""Diagnostics: their content, the spans that they mark, and their rendering for people and
programs. All other folders of the compiler report diagnostics; this one reports none."""
