"""The codes of findings with their explanations and examples, and formats for programs: SARIF and
GitHub annotations."""
