"""Text to nodes with spans, and a node to one typed value or attached file. Reads files, up to a
bound, and knows nothing of missions. The later passes call it, and so does the listing of missions
and libraries."""
