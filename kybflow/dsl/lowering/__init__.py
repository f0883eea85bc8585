"""The document to the plan: frozen, SI, groups resolved to vehicles."""
