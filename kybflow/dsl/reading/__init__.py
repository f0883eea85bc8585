"""YAML text to nodes with spans, and a node to one typed value or attached file. Files are read up
to a maximum size; nothing here depends on missions. The later passes use this folder, and so does
the listing of missions and libraries."""
