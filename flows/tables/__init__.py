"""The paper's experiments as data: one TOML file a table, rows are names and the settings by which they differ."""

from flows.tables.loading import TableError, load_table, table_names
from flows.tables.types import Column, Figure, Reference, Row, Size, Table

__all__ = ["Column", "Figure", "Reference", "Row", "Size", "Table", "TableError", "load_table", "table_names"]
