"""What findings mean and how programs read them: the codes with their explanations and examples,
and the formats SARIF and GitHub annotations."""
