"""The document to the plan: frozen, in SI, groups resolved to vehicles. Finds nothing: a document
gets here without errors. Only the compiler calls it.
"""
