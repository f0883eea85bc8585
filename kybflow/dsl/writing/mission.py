def to_yaml(plan): return ""
