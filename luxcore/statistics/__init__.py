"""The first page that a reader of a dataset or of a shard looks at: what is in it, in numbers."""
