"""What is said about the gap: a page, sections of pages, tables for terminals."""
